# LCM (Lightweight Communications and Marshalling).  Debian ships no CMake files, and its .pc file
# needs glib headers that carom does not: headers and library are looked for directly.
# Target: LCM::lcm.  With the component gen also LCM_GEN, the executable lcm-gen.
find_path(LCM_INCLUDE_DIR lcm/lcm.h)
find_library(LCM_LIBRARY lcm)
find_program(LCM_GEN lcm-gen)
include(FindPackageHandleStandardArgs)
set(required LCM_LIBRARY LCM_INCLUDE_DIR)
if("gen" IN_LIST LCM_FIND_COMPONENTS)
  list(APPEND required LCM_GEN)
endif()
find_package_handle_standard_args(LCM REQUIRED_VARS ${required}
  REASON_FAILURE_MESSAGE "install liblcm-dev and liblcm-bin, or set CAROM_BUILD_DAEMON=OFF and CAROM_BUILD_CLIENTS=OFF")
if(LCM_FOUND AND NOT TARGET LCM::lcm)
  add_library(LCM::lcm UNKNOWN IMPORTED)
  set_target_properties(LCM::lcm PROPERTIES IMPORTED_LOCATION ${LCM_LIBRARY}
    INTERFACE_INCLUDE_DIRECTORIES ${LCM_INCLUDE_DIR})
endif()
mark_as_advanced(LCM_INCLUDE_DIR LCM_LIBRARY LCM_GEN)

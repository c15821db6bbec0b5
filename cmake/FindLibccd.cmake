# libccd, double precision.  Target: Libccd::ccd.
find_path(LIBCCD_INCLUDE_DIR ccd/ccd.h)
find_library(LIBCCD_LIBRARY ccd)
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(Libccd REQUIRED_VARS LIBCCD_LIBRARY LIBCCD_INCLUDE_DIR
  REASON_FAILURE_MESSAGE "install libccd-dev, or set CAROM_BUILD_WORLD=OFF")
if(Libccd_FOUND AND NOT TARGET Libccd::ccd)
  add_library(Libccd::ccd UNKNOWN IMPORTED)
  set_target_properties(Libccd::ccd PROPERTIES IMPORTED_LOCATION ${LIBCCD_LIBRARY}
    INTERFACE_INCLUDE_DIRECTORIES ${LIBCCD_INCLUDE_DIR})
endif()
mark_as_advanced(LIBCCD_INCLUDE_DIR LIBCCD_LIBRARY)

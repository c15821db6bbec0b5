# How every carom target is compiled: usage requirements on targets, no global flags.

if(CAROM_SANITIZE)
  set(known address undefined memory thread)
  foreach(s IN LISTS CAROM_SANITIZE)
    if(NOT s IN_LIST known)
      message(FATAL_ERROR "CAROM_SANITIZE: '${s}' is none of ${known}")
    endif()
  endforeach()
  string(REPLACE ";" "," CAROM_SANITIZE_FLAG "-fsanitize=${CAROM_SANITIZE}")
endif()

# carom_flags(target): language, warnings, determinism, sanitizers.
function(carom_flags target)
  set_target_properties(${target} PROPERTIES
    C_STANDARD 99 C_STANDARD_REQUIRED ON C_EXTENSIONS OFF
    C_VISIBILITY_PRESET hidden POSITION_INDEPENDENT_CODE ON)
  # No contraction: the same bits on every machine with IEEE doubles.
  target_compile_options(${target} PRIVATE -ffp-contract=off -Wall -Wextra -pedantic -Wshadow
    -Wconversion -Wstrict-prototypes -Wmissing-prototypes -Wvla -Wundef)
  if(CAROM_WERROR)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
  if(CAROM_CHECKS)
    target_compile_definitions(${target} PRIVATE CAROM_CHECKS)
  endif()
  if(CAROM_SANITIZE)
    target_compile_options(${target} PRIVATE ${CAROM_SANITIZE_FLAG} -fno-omit-frame-pointer
      -fno-sanitize-recover=all)
    target_link_options(${target} PUBLIC ${CAROM_SANITIZE_FLAG})
  endif()
endfunction()

# carom_library(name PUBLIC_INCLUDE dir SOURCES ...): libcarom_<name>, exported as carom::<name>.
function(carom_library name)
  cmake_parse_arguments(L "" "INCLUDE;EXPORT" "SOURCES" ${ARGN})
  add_library(carom_${name} ${L_SOURCES})
  add_library(carom::${L_EXPORT} ALIAS carom_${name})
  carom_flags(carom_${name})
  set_target_properties(carom_${name} PROPERTIES EXPORT_NAME ${L_EXPORT}
    VERSION ${PROJECT_VERSION} SOVERSION ${PROJECT_VERSION_MAJOR})
  target_include_directories(carom_${name} PUBLIC
    $<BUILD_INTERFACE:${L_INCLUDE}> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  install(TARGETS carom_${name} EXPORT carom-targets
    ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
endfunction()

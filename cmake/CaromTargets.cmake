# How every carom target is compiled: usage requirements on targets, no global flags.
include(CheckCSourceCompiles)

if(CAROM_SANITIZE)
  set(known address undefined memory thread)
  foreach(s IN LISTS CAROM_SANITIZE)
    if(NOT s IN_LIST known)
      message(FATAL_ERROR "CAROM_SANITIZE: '${s}' is none of ${known}")
    endif()
  endforeach()
  string(REPLACE ";" "," CAROM_SANITIZE_FLAG "-fsanitize=${CAROM_SANITIZE}")
  string(MAKE_C_IDENTIFIER "CAROM_LINKS${CAROM_SANITIZE_FLAG}" links)
  set(CMAKE_REQUIRED_FLAGS ${CAROM_SANITIZE_FLAG})
  check_c_source_compiles("int main(void) { return 0; }" ${links})
  unset(CMAKE_REQUIRED_FLAGS)
  if(NOT ${links})
    message(FATAL_ERROR
      "CAROM_SANITIZE: ${CMAKE_C_COMPILER_ID} does not build with ${CAROM_SANITIZE_FLAG}")
  endif()
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
  if(BUILD_SHARED_LIBS)
    file(RELATIVE_PATH to_lib ${CMAKE_INSTALL_FULL_BINDIR} ${CMAKE_INSTALL_FULL_LIBDIR})
    set_target_properties(${target} PROPERTIES INSTALL_RPATH "$ORIGIN;$ORIGIN/${to_lib}")
    if(CMAKE_SYSTEM_NAME STREQUAL "Linux" AND NOT CAROM_SANITIZE)
      target_link_options(${target} PRIVATE -Wl,--no-undefined)
    endif()
  endif()
endfunction()

# carom_library(name EXPORT component INCLUDE dir SOURCES ...): libcarom_<name> (libcarom for
# carom), exported as carom::<component>.
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
  if(name STREQUAL carom)
    set_target_properties(carom_carom PROPERTIES OUTPUT_NAME carom)
  endif()
  set_property(GLOBAL APPEND PROPERTY CAROM_LIBRARIES carom_${name})
  if(BUILD_SHARED_LIBS AND CAROM_BUILD_TESTS)
    carom_inside(carom_${name})
  endif()
endfunction()

# carom_inside(library): <library>_inside, the same sources as a static library.  Tests look inside,
# and a shared library hides its inside.
function(carom_inside library)
  add_library(${library}_inside STATIC EXCLUDE_FROM_ALL $<TARGET_PROPERTY:${library},SOURCES>)
  carom_flags(${library}_inside)
  target_include_directories(${library}_inside PUBLIC
    $<TARGET_PROPERTY:${library},INCLUDE_DIRECTORIES>)
  target_compile_definitions(${library}_inside PRIVATE
    $<TARGET_PROPERTY:${library},COMPILE_DEFINITIONS>)
  target_link_libraries(${library}_inside PUBLIC $<TARGET_PROPERTY:${library},LINK_LIBRARIES>)
endfunction()

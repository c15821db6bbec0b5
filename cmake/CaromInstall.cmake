# Installation: headers and libraries are installed where they are made; here follow the CMake
# package (find_package(carom)) and one pkg-config file per library, both written from what the
# targets link, so that they hold for static and shared builds and for every set of options.
include(CMakePackageConfigHelpers)

# What a user of an installed static library has to find.  target | find_package | -l | file found
set(CAROM_EXTERNAL
  "Libccd::ccd|Libccd|-lccd|LIBCCD_LIBRARY"
  "SuiteSparse::AMD|CaromSuiteSparse:AMD|-lamd -lsuitesparseconfig|AMD_LIBRARY"
  "SuiteSparse::KLU|CaromSuiteSparse:KLU|-lklu -lbtf -lcolamd -lamd -lsuitesparseconfig|KLU_LIBRARY"
  "LCM::lcm|LCM|-llcm|LCM_LIBRARY"
  "Jansson::jansson|Jansson|-ljansson|JANSSON_LIBRARY"
  "Threads::Threads|Threads|-pthread|"
  "m||-lm|")

# carom_uses(out target): what linking with `target` links, each once, dependents first: names of
# carom's targets and of external ones.  Private parts of static libraries are among them.
function(carom_uses out target)
  get_target_property(links ${target} INTERFACE_LINK_LIBRARIES)
  set(all)
  foreach(link IN LISTS links)
    string(REGEX REPLACE "^\\$<LINK_ONLY:(.*)>$" "\\1" link "${link}")
    if(NOT link OR link MATCHES "^\\$<BUILD_INTERFACE:")
      continue()
    endif()
    if(TARGET ${link})
      get_target_property(aliased ${link} ALIASED_TARGET)
      if(aliased)
        set(link ${aliased})
      endif()
    endif()
    list(APPEND all ${link})
    if(link MATCHES "^carom_")
      carom_uses(inner ${link})
      list(APPEND all ${inner})
    endif()
  endforeach()
  list(REVERSE all)
  list(REMOVE_DUPLICATES all)
  list(REVERSE all)
  set(${out} ${all} PARENT_SCOPE)
endfunction()

# carom_external(target prefix): ${prefix}_package, _flags, _file of an external target.
function(carom_external target prefix)
  foreach(line IN LISTS CAROM_EXTERNAL)
    string(REPLACE "|" ";" field "${line}")
    list(GET field 0 name)
    if(name STREQUAL target)
      list(GET field 1 package)
      list(GET field 2 flags)
      list(GET field 3 file)
      set(${prefix}_package "${package}" PARENT_SCOPE)
      set(${prefix}_flags "${flags}" PARENT_SCOPE)
      set(${prefix}_file "${${file}}" PARENT_SCOPE)
      return()
    endif()
  endforeach()
  message(FATAL_ERROR "CaromInstall: '${target}' is linked but CAROM_EXTERNAL does not list it")
endfunction()

# carom_pkgconfig(name target): <name>.pc.  Where carom is static, Libs is all that a link needs;
# where it is shared, the libraries bring their own.
function(carom_pkgconfig name target)
  carom_uses(uses ${target})
  set(libs)
  set(folders)
  foreach(use IN LISTS target uses)
    if(use MATCHES "^carom_")
      get_target_property(output ${use} OUTPUT_NAME)
      if(NOT output)
        set(output ${use})
      endif()
      string(APPEND libs " -l${output}")
    else()
      carom_external(${use} external)
      string(APPEND libs " ${external_flags}")
      get_filename_component(folder "${external_file}" DIRECTORY)
      if(folder AND NOT folder IN_LIST CMAKE_C_IMPLICIT_LINK_DIRECTORIES)
        list(APPEND folders "-L${folder}")
      endif()
    endif()
  endforeach()
  list(REMOVE_DUPLICATES folders)
  list(JOIN folders " " folders)
  string(STRIP "${folders}${libs}" CAROM_PC_LIBS)
  set(CAROM_PC_NAME ${name})
  configure_file(${PROJECT_SOURCE_DIR}/cmake/carom.pc.in ${PROJECT_BINARY_DIR}/${name}.pc @ONLY)
  install(FILES ${PROJECT_BINARY_DIR}/${name}.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
endfunction()

# Folders of the .pc files are relative to the files themselves: an installed tree can be moved.
file(RELATIVE_PATH CAROM_PC_PREFIX ${CMAKE_INSTALL_FULL_LIBDIR}/pkgconfig ${CMAKE_INSTALL_PREFIX})
string(REGEX REPLACE "/$" "" CAROM_PC_PREFIX "${CAROM_PC_PREFIX}")
foreach(dir LIBDIR INCLUDEDIR)
  if(IS_ABSOLUTE ${CMAKE_INSTALL_${dir}})
    set(CAROM_PC_${dir} ${CMAKE_INSTALL_${dir}})
  else()
    set(CAROM_PC_${dir} "\${prefix}/${CMAKE_INSTALL_${dir}}")
  endif()
endforeach()

get_property(libraries GLOBAL PROPERTY CAROM_LIBRARIES)
set(CAROM_COMPONENTS)
set(CAROM_NEEDS)
foreach(library IN LISTS libraries)
  get_target_property(component ${library} EXPORT_NAME)
  list(APPEND CAROM_COMPONENTS ${component})
  carom_uses(uses ${library})
  set(needs)
  foreach(use IN LISTS uses)
    if(NOT use MATCHES "^carom_")
      carom_external(${use} external)
      list(APPEND needs ${external_package})
    endif()
  endforeach()
  list(REMOVE_DUPLICATES needs)
  string(APPEND CAROM_NEEDS "set(carom_needs_${component} ${needs})\n")
  if(component STREQUAL carom)
    carom_pkgconfig(carom ${library})
  else()
    carom_pkgconfig(carom-${component} ${library})
  endif()
endforeach()

set(CAROM_CMAKE_DIR ${CMAKE_INSTALL_LIBDIR}/cmake/carom)
configure_package_config_file(cmake/carom-config.cmake.in carom-config.cmake
  INSTALL_DESTINATION ${CAROM_CMAKE_DIR} NO_SET_AND_CHECK_MACRO)
# Before 1.0 a minor version may break what the one before promised.
write_basic_package_version_file(carom-config-version.cmake COMPATIBILITY SameMinorVersion)
install(EXPORT carom-targets NAMESPACE carom:: DESTINATION ${CAROM_CMAKE_DIR})
install(FILES ${PROJECT_BINARY_DIR}/carom-config.cmake
  ${PROJECT_BINARY_DIR}/carom-config-version.cmake DESTINATION ${CAROM_CMAKE_DIR})
install(FILES cmake/FindCaromSuiteSparse.cmake cmake/FindLibccd.cmake cmake/FindLCM.cmake
  cmake/FindJansson.cmake DESTINATION ${CAROM_CMAKE_DIR}/modules)

# SuiteSparse components AMD and KLU.  Version 7 brings CMake files; version 5 (Debian 12) does not.
# Targets: SuiteSparse::AMD and, when the component KLU is asked for, SuiteSparse::KLU.
set(required)
find_package(AMD CONFIG QUIET)
if(NOT TARGET SuiteSparse::AMD)
  find_path(AMD_INCLUDE_DIR amd.h PATH_SUFFIXES suitesparse)
  find_library(AMD_LIBRARY amd)
  find_library(SUITESPARSECONFIG_LIBRARY suitesparseconfig)
  list(APPEND required AMD_LIBRARY SUITESPARSECONFIG_LIBRARY AMD_INCLUDE_DIR)
  mark_as_advanced(AMD_INCLUDE_DIR AMD_LIBRARY SUITESPARSECONFIG_LIBRARY)
endif()
if("KLU" IN_LIST CaromSuiteSparse_FIND_COMPONENTS)
  find_package(KLU CONFIG QUIET)
  if(NOT TARGET SuiteSparse::KLU)
    find_path(KLU_INCLUDE_DIR klu.h PATH_SUFFIXES suitesparse)
    find_library(KLU_LIBRARY klu)
    find_library(BTF_LIBRARY btf)
    find_library(COLAMD_LIBRARY colamd)
    list(APPEND required KLU_LIBRARY BTF_LIBRARY COLAMD_LIBRARY KLU_INCLUDE_DIR)
    mark_as_advanced(KLU_INCLUDE_DIR KLU_LIBRARY BTF_LIBRARY COLAMD_LIBRARY)
  endif()
endif()
include(FindPackageHandleStandardArgs)
if(required)
  find_package_handle_standard_args(CaromSuiteSparse REQUIRED_VARS ${required}
    REASON_FAILURE_MESSAGE "install libsuitesparse-dev")
else()
  set(CaromSuiteSparse_FOUND TRUE)
endif()
if(CaromSuiteSparse_FOUND AND NOT TARGET SuiteSparse::AMD)
  add_library(SuiteSparse::AMD UNKNOWN IMPORTED)
  set_target_properties(SuiteSparse::AMD PROPERTIES IMPORTED_LOCATION ${AMD_LIBRARY}
    INTERFACE_INCLUDE_DIRECTORIES ${AMD_INCLUDE_DIR}
    INTERFACE_LINK_LIBRARIES ${SUITESPARSECONFIG_LIBRARY})
endif()
if(CaromSuiteSparse_FOUND AND "KLU" IN_LIST CaromSuiteSparse_FIND_COMPONENTS
   AND NOT TARGET SuiteSparse::KLU)
  add_library(SuiteSparse::KLU UNKNOWN IMPORTED)
  set_target_properties(SuiteSparse::KLU PROPERTIES IMPORTED_LOCATION ${KLU_LIBRARY}
    INTERFACE_INCLUDE_DIRECTORIES ${KLU_INCLUDE_DIR}
    INTERFACE_LINK_LIBRARIES "${BTF_LIBRARY};${COLAMD_LIBRARY};SuiteSparse::AMD")
endif()

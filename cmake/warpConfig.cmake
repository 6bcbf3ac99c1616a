# find_package(warp): the target warp::warp of an installed package, headers
# and libwarp.so. This file lies in `warp/cmake`.
get_filename_component(_warp_root "${CMAKE_CURRENT_LIST_DIR}/.." ABSOLUTE)
if(NOT TARGET warp::warp)
  add_library(warp::warp SHARED IMPORTED)
  set_target_properties(warp::warp PROPERTIES
    IMPORTED_LOCATION "${_warp_root}/libwarp.so"
    INTERFACE_INCLUDE_DIRECTORIES "${_warp_root}/include")
  target_compile_features(warp::warp INTERFACE cxx_std_17)
endif()
set(warp_FOUND TRUE)
unset(_warp_root)

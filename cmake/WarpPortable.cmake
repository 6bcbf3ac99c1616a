# warp_link_portably(TARGET): with WARP_PORTABLE, TARGET asks for no symbol version
# beyond manylinux_2_28 (glibc 2.28, GCC 8). It is linked against stubs of the
# run-time libraries that end there; `libstdc++.a` and lib/Portable have the rest.
if(WARP_PORTABLE)
  set(stubs "${PROJECT_BINARY_DIR}/link-stubs")
  set(make_stubs "${PROJECT_SOURCE_DIR}/scripts/make_link_stubs.py")
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS "${make_stubs}")
  find_program(WARP_PLAIN_PYTHON python3 REQUIRED)
  execute_process(
    COMMAND "${WARP_PLAIN_PYTHON}" "${make_stubs}" "${stubs}"
      --compiler "${CMAKE_C_COMPILER}"
    COMMAND_ERROR_IS_FATAL ANY)
  add_library(WarpPortable OBJECT "${PROJECT_SOURCE_DIR}/lib/Portable/glibc.c")
endif()

function(warp_link_portably target)
  if(NOT WARP_PORTABLE)
    return()
  endif()
  target_sources(${target} PRIVATE $<TARGET_OBJECTS:WarpPortable>)
  # Before 2.34 threads and dlopen were libraries of their own.
  target_link_options(${target} PRIVATE "-L${stubs}" -Wl,--exclude-libs,ALL
    -Wl,--no-as-needed -lpthread -ldl -lrt -Wl,--as-needed)
endfunction()

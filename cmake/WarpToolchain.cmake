# Compiler launcher, warnings, and link flags common to every target.

find_program(WARP_CCACHE ccache)
if(WARP_CCACHE)
  set(CMAKE_CXX_COMPILER_LAUNCHER "${WARP_CCACHE}")
  set(CMAKE_C_COMPILER_LAUNCHER "${WARP_CCACHE}")
endif()

add_compile_options(
  -ffunction-sections -fdata-sections
  $<$<COMPILE_LANGUAGE:CXX>:-Wall>
  $<$<COMPILE_LANGUAGE:CXX>:-Wextra>
  $<$<COMPILE_LANGUAGE:CXX>:-Wno-unused-parameter>)
if(WARP_WERROR)
  add_compile_options($<$<COMPILE_LANGUAGE:CXX>:-Werror>)
endif()

# lld does not care about the order of archives, drops dead sections fast, and
# records a shared library as needed only if live code refers to it.
add_link_options(-fuse-ld=lld -Wl,--gc-sections -Wl,--as-needed
  -Wl,--build-id=sha1)

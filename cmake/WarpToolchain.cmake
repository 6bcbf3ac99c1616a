# Processor, compiler launcher, warnings, and link flags common to every target.

# Of the machine that runs what is built; kernels for the CPU are for it as well.
if(CMAKE_SYSTEM_PROCESSOR MATCHES "^(x86_64|AMD64)$")
  set(WARP_PROCESSOR x86-64)
  set(WARP_LLVM_BACKEND X86)
elseif(CMAKE_SYSTEM_PROCESSOR MATCHES "^(aarch64|arm64)$")
  set(WARP_PROCESSOR aarch64)
  set(WARP_LLVM_BACKEND AArch64)
else()
  message(FATAL_ERROR "no code generation for processor "
    "'${CMAKE_SYSTEM_PROCESSOR}'; there is for x86_64 and aarch64")
endif()

find_program(WARP_CCACHE ccache)
if(WARP_CCACHE)
  # Clones at different places share compiled objects; a precompiled header
  # counts by the checksum beside it.
  set(launcher "${CMAKE_COMMAND}" -E env
    "CCACHE_BASEDIR=${PROJECT_SOURCE_DIR}" CCACHE_NOHASHDIR=1
    CCACHE_SLOPPINESS=pch_defines,time_macros CCACHE_PCH_EXTSUM=1
    "${WARP_CCACHE}")
  set(CMAKE_CXX_COMPILER_LAUNCHER "${launcher}")
  set(CMAKE_C_COMPILER_LAUNCHER "${launcher}")
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
# A release keeps one of functions that are the same (9 MB of 73) and shares the
# ends of strings.
add_link_options(-fuse-ld=lld -Wl,--gc-sections -Wl,--as-needed
  -Wl,--build-id=sha1 $<$<CONFIG:Release>:-Wl,--icf=all,-O2>)

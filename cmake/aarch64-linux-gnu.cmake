# Builds for Linux on aarch64 on another machine:
#
#   scripts/fetch_aarch64_root.py build/aarch64-root
#   ninja -C build warp-tblgen
#   cmake --preset aarch64
#
# The root holds Debian's packages for that machine: the C and C++ libraries,
# LLVM's archives, Python. Programs that the build runs are those of the machine
# that builds; WARP_TBLGEN is a `warp-tblgen` for it. With qemu-aarch64 at hand
# tests run, too.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES WARP_SYSROOT)
if(NOT WARP_SYSROOT)
  set(WARP_SYSROOT "${CMAKE_CURRENT_LIST_DIR}/../build/aarch64-root")
endif()
get_filename_component(CMAKE_SYSROOT "${WARP_SYSROOT}" ABSOLUTE)
set(CMAKE_LIBRARY_ARCHITECTURE aarch64-linux-gnu)
set(CMAKE_C_COMPILER clang-22)
set(CMAKE_CXX_COMPILER clang++-22)
foreach(language C CXX ASM)
  set(CMAKE_${language}_COMPILER_TARGET aarch64-linux-gnu)
endforeach()
foreach(kind EXE SHARED MODULE)
  set(CMAKE_${kind}_LINKER_FLAGS_INIT -fuse-ld=lld)
endforeach()

# MLIR's CMake files name programs, so they are those of this machine.
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)

find_program(WARP_EMULATOR NAMES qemu-aarch64-static qemu-aarch64)
if(WARP_EMULATOR)
  set(CMAKE_CROSSCOMPILING_EMULATOR "${WARP_EMULATOR};-L;${CMAKE_SYSROOT}")
endif()

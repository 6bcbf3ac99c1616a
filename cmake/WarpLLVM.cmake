# LLVM and MLIR from the distribution's packages, linked statically.
#
# The packages' CMake targets pull in libLLVM.so, because the distribution
# builds MLIR against it. A process may already hold another LLVM (PyTorch,
# JAX and Triton bring theirs), so we take the static archives instead: the
# interface target `warp_llvm` lists every archive that could be needed, for
# the NVPTX target and this processor's only, and the linker extracts what is
# used. CMake's files of LLVM name programs, so a build for another processor
# reads those of the machine that builds, and takes archives and headers of the
# same version from the other's root.

find_package(MLIR REQUIRED CONFIG HINTS /usr/lib/llvm-22/lib/cmake/mlir)
if(NOT LLVM_VERSION_MAJOR EQUAL 22)
  message(FATAL_ERROR "needs LLVM 22, but found ${LLVM_VERSION}")
endif()
set(LLVM_DEFAULT_EXTERNAL_LIT "${LLVM_TOOLS_BINARY_DIR}/lit")
list(APPEND CMAKE_MODULE_PATH "${MLIR_CMAKE_DIR}" "${LLVM_CMAKE_DIR}")
include(TableGen)
include(AddLLVM)
include(AddMLIR)
# Our own assertions stay on whatever the packages were built with.
set(LLVM_ENABLE_ASSERTIONS ON)

find_program(WARP_CLANG NAMES clang++-22
  HINTS "${LLVM_TOOLS_BINARY_DIR}" REQUIRED)
find_program(WARP_LLVM_LINK NAMES llvm-link
  HINTS "${LLVM_TOOLS_BINARY_DIR}" NO_DEFAULT_PATH REQUIRED)
find_program(WARP_LLVM_AR NAMES llvm-ar
  HINTS "${LLVM_TOOLS_BINARY_DIR}" NO_DEFAULT_PATH REQUIRED)
find_program(WARP_ZSTD_TOOL zstd REQUIRED)

if(CMAKE_CROSSCOMPILING)
  set(warp_llvm_root "${CMAKE_SYSROOT}/usr/lib/llvm-22")
  set(LLVM_LIBRARY_DIR "${warp_llvm_root}/lib")
  set(LLVM_INCLUDE_DIRS "${warp_llvm_root}/include")
  set(MLIR_INCLUDE_DIRS "${warp_llvm_root}/include")
  file(STRINGS "${warp_llvm_root}/include/llvm/Config/llvm-config.h" version
    REGEX "define LLVM_VERSION_STRING")
  if(NOT version MATCHES "\"${LLVM_PACKAGE_VERSION}\"")
    message(FATAL_ERROR "LLVM ${LLVM_PACKAGE_VERSION} of this machine, but for "
      "aarch64: ${version}")
  endif()
endif()
file(GLOB warp_archives LIST_DIRECTORIES false
  "${LLVM_LIBRARY_DIR}/libMLIR*.a" "${LLVM_LIBRARY_DIR}/libLLVM*.a")
list(FILTER warp_archives EXCLUDE REGEX
  "lib(MLIRCAPI|MLIR.*Test|MLIRMlirOptMain|LLVMExegesis|LLVMBOLT|LLVMFuzz)")
set(others AArch64 AMDGPU ARM AVR BPF Hexagon Lanai LoongArch M68k MSP430 Mips
  PowerPC RISCV Sparc SPIRV SystemZ VE WebAssembly X86 XCore Xtensa)
list(REMOVE_ITEM others "${WARP_LLVM_BACKEND}")
list(JOIN others "|" others)
list(FILTER warp_archives EXCLUDE REGEX
  "libLLVM(${others})(AsmParser|CodeGen|Desc|Disassembler|Info|Utils|Analysis|TargetMCA)")
if(NOT warp_archives)
  message(FATAL_ERROR "no static LLVM archives in '${LLVM_LIBRARY_DIR}'; "
    "install llvm-22-dev and libmlir-22-dev")
endif()

# Static, so that the library needs nothing beyond the C and C++ run time.
find_library(WARP_ZLIB libz.a REQUIRED)
find_library(WARP_ZSTD libzstd.a REQUIRED)

add_library(warp_llvm INTERFACE)
target_include_directories(warp_llvm SYSTEM INTERFACE
  ${LLVM_INCLUDE_DIRS} ${MLIR_INCLUDE_DIRS})
target_link_libraries(warp_llvm INTERFACE
  ${warp_archives} "${WARP_ZLIB}" "${WARP_ZSTD}" pthread dl m rt)

separate_arguments(warp_llvm_definitions UNIX_COMMAND "${LLVM_DEFINITIONS}")
target_compile_options(warp_llvm INTERFACE ${warp_llvm_definitions})

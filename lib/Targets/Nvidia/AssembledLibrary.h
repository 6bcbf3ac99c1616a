//===- AssembledLibrary.h - Cubins of the device library --------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The counterpart of LibraryObject.h: searches and the algebra of tiles, for
// which the driver's assembler needs most of a first launch, are assembled when
// the library is built, once for each family of GPUs. Quickly compiled kernels
// call them, and the driver links both. In tier-1 code they are part of the
// kernel, for what it passes and with its registers.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TARGETS_NVIDIA_ASSEMBLEDLIBRARY_H
#define WARP_LIB_TARGETS_NVIDIA_ASSEMBLEDLIBRARY_H

#include "llvm/ADT/StringRef.h"

namespace llvm {
class Function;
class Module;
} // namespace llvm

namespace warp {

/// The device library for GPUs without and with functions of tiles, as LLVM
/// bitcode.
llvm::StringRef gpuLibrary();
llvm::StringRef gpuTileLibrary();

/// True if the assembled library for a target, "sm_90a", has a function: one of
/// those exported by the sources that lib/DeviceLib/CMakeLists.txt lists for
/// it.
bool isAssembled(llvm::StringRef symbol, llvm::StringRef target);
/// True if a module declares any such function that is long.
bool callsAssembled(const llvm::Module &module, llvm::StringRef target);

/// Keeps such declarations as calls while it lives: linking a library does not
/// see them, and `isKept` says so.
class AssembledCalls {
public:
  AssembledCalls(llvm::Module &module, llvm::StringRef target);
  ~AssembledCalls();

  static bool isKept(const llvm::Function &function);

private:
  llvm::Module &module;
};

} // namespace warp

#endif // WARP_LIB_TARGETS_NVIDIA_ASSEMBLEDLIBRARY_H

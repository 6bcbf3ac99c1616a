//===- Reductions.h - Atomic reductions without result ----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TARGETS_NVIDIA_REDUCTIONS_H
#define WARP_LIB_TARGETS_NVIDIA_REDUCTIONS_H

namespace llvm {
class Module;
} // namespace llvm

namespace warp {

/// Makes `red` instructions of atomic updates of a GPU's global memory whose
/// results have no use.
void useReductions(llvm::Module &module);

} // namespace warp

#endif // WARP_LIB_TARGETS_NVIDIA_REDUCTIONS_H

//===- WarpSums.h - One atomic for the threads of a warp --------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_WARPSUMS_H
#define WARP_LIB_TRANSFORMS_WARPSUMS_H

#include "mlir/Dialect/LLVMIR/LLVMDialect.h"

namespace warp {

/// Combines updates of the entry of a GPU launch where all lanes of a warp make
/// one of the same element.
void combineOverWarps(mlir::LLVM::LLVMFuncOp entry);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_WARPSUMS_H

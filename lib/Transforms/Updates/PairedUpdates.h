//===- PairedUpdates.h - Vector atomics of two components -------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_PAIREDUPDATES_H
#define WARP_LIB_TRANSFORMS_PAIREDUPDATES_H

#include "Targets/Target.h"
#include "WarpDialect/ParameterLayout.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/IR/Builders.h"

namespace warp {

/// True if the entry's GPU can perform this update, of an element with these
/// parts at an address that is a multiple of `alignment`, by `addInPairs`.
bool canAddInPairs(mlir::Operation *entry, AtomicComponentsOp op,
                   llvm::ArrayRef<Leaf> leaves, mlir::Value pointer,
                   int64_t alignment);

/// Adds floats atomically to those that follow each other from `pointer` on.
void addInPairs(mlir::OpBuilder &b, mlir::Location loc,
                const TargetInfo &target, mlir::ValueRange values,
                mlir::Value pointer);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_PAIREDUPDATES_H

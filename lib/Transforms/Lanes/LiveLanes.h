//===- LiveLanes.h - Loop over the set bits of a mask -----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_LIVELANES_H
#define WARP_LIB_TRANSFORMS_LIVELANES_H

#include "mlir/IR/Builders.h"

#include <optional>

namespace warp {

/// The bit that all lanes of a mask have; none if they differ, or are not
/// known.
std::optional<bool> getConstantMask(mlir::Value mask);

/// True if a mask certainly has all lanes.
bool isFullMask(mlir::Value mask);

/// A loop over the live lanes, in their order; `body` gets the number of one,
/// i64. The insertion point is behind the loop afterwards.
void forLiveLanes(mlir::OpBuilder &b, mlir::Location loc, mlir::Value mask,
                  llvm::function_ref<void(mlir::Value)> body);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_LIVELANES_H

//===- UnrollLocals.h - Loops over components of long values ----*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_COMPOSITES_UNROLLLOCALS_H
#define WARP_TRANSFORMS_COMPOSITES_UNROLLLOCALS_H

namespace mlir {
class FunctionOpInterface;
} // namespace mlir

namespace warp {

/// The composites that loops are written out for.
enum class UnrollFor {
  /// The variables that would be in memory.
  Long,
  /// All of them, if that makes moderate code: what derivatives gain by it.
  Any,
};

/// Copies the bodies of short loops with which all indices of these composites
/// become constants.
void unrollLocals(mlir::FunctionOpInterface function, UnrollFor composites);

} // namespace warp

#endif // WARP_TRANSFORMS_COMPOSITES_UNROLLLOCALS_H

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

/// Copies the bodies of short loops with which all indices of long composites
/// become constants, so that these need no memory.
void unrollLocals(mlir::FunctionOpInterface function);

} // namespace warp

#endif // WARP_TRANSFORMS_COMPOSITES_UNROLLLOCALS_H

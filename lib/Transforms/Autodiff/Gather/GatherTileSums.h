//===- GatherTileSums.h - Sums of products over blocks ----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_GATHERTILESUMS_H
#define WARP_TRANSFORMS_AUTODIFF_GATHERTILESUMS_H

#include "mlir/Dialect/Func/IR/FuncOps.h"

namespace warp::autodiff {

/// Takes sums of products that blocks add to gradients together out of an
/// adjoint with tiles, and adds a function in front of it that does without
/// most of these additions; false if there are none. It is for launches of one
/// dimension more than the adjoint has thread indices, that of a block's
/// threads, and has their extents as further parameters.
bool gatherTileSums(mlir::func::FuncOp adjoint);

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_GATHERTILESUMS_H

//===- GuardArms.h - Guarded select operands --------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_GUARDARMS_H
#define WARP_TRANSFORMS_AUTODIFF_GUARDARMS_H

namespace mlir {
class Operation;
} // namespace mlir

namespace warp::autodiff {

/// Makes choices whose arms may have infinite derivatives branches.
void guardArms(mlir::Operation *function);

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_GUARDARMS_H

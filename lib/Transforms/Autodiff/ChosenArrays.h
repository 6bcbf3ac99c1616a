//===- ChosenArrays.h - Arrays selected by control flow ---------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_CHOSENARRAYS_H
#define WARP_TRANSFORMS_AUTODIFF_CHOSENARRAYS_H

namespace mlir {
class Operation;
} // namespace mlir

namespace warp::autodiff {

/// Makes an access of an array that branches or loops choose a branch for each
/// array that it may be. Accesses stay as they are where that is not known, or
/// where the array cannot be had at the access.
void nameChosenArrays(mlir::Operation *function);

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_CHOSENARRAYS_H

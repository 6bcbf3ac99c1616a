//===- CarryElements.h - Scalar promotion of loop updates -------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_CARRYELEMENTS_H
#define WARP_TRANSFORMS_AUTODIFF_CARRYELEMENTS_H

#include "Autodiff/MemoryClasses.h"

namespace warp::autodiff {

/// Makes elements that a counted loop loads and stores values that the loop
/// carries. Arrays do not overlap.
void carryElements(mlir::FunctionOpInterface function,
                   const ArrayLeaves &leaves);

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_CARRYELEMENTS_H

//===- CountTrips.h - Tape size of a launch ---------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_COUNTTRIPS_H
#define WARP_TRANSFORMS_AUTODIFF_COUNTTRIPS_H

#include "mlir/Dialect/Func/IR/FuncOps.h"

namespace warp::autodiff {

/// Takes what counts trips out of an adjoint, as a function next to it. Null if
/// no loop of the adjoint keeps its iterations in a tape.
mlir::func::FuncOp takeCounting(mlir::func::FuncOp adjoint);

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_COUNTTRIPS_H

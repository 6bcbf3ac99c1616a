//===- CostModel.h - What operations cost -----------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Rough operations, by which passes and the runtime compare ways to do a
// thing. A factor of two does not matter; a missing loop does.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_ANALYSIS_COSTMODEL_H
#define WARP_LIB_ANALYSIS_COSTMODEL_H

namespace warp::cost {

/// Trips of a loop of which nothing is known.
constexpr double loopTrips = 32;
/// An elementary function.
constexpr double function = 10;
/// An atomic update of one component.
constexpr double atomic = 20;

} // namespace warp::cost

#endif // WARP_LIB_ANALYSIS_COSTMODEL_H

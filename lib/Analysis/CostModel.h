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
/// The same made plainly, as where one thread runs a launch.
constexpr double plainUpdate = 2;
/// An exact sum of one component takes a float apart for two updates or three:
/// plainly, and with atomic instructions.
constexpr double exactSum = 15, atomicExactSum = 50;
/// How much quicker threads as lanes do what is neither update nor loop.
constexpr double gainOfLanes = 6;
constexpr double cyclesPerNanosecond = 3;

/// Operations that it is worth to compute again to be rid of an atomic addition
/// of an adjoint, be it on a CPU or on a GPU.
constexpr double gatheredAtomic = 64;

} // namespace warp::cost

#endif // WARP_LIB_ANALYSIS_COSTMODEL_H

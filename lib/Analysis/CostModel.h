//===- CostModel.h - Costs of operations ------------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Rough operations, by which passes and the runtime compare ways to do a
// thing. A factor of two does not matter; a missing loop does.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_ANALYSIS_COSTMODEL_H
#define WARP_LIB_ANALYSIS_COSTMODEL_H

#include <cstdint>

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

/// The accumulators that a thread can keep before register pressure spills
/// them.
constexpr int64_t mostSums = 16;
/// Lanes of a warp that combine what they add to one element: fewer are done
/// sooner one after the other.
constexpr int64_t leastCombined = 4;
/// Threads in a row that may update one element, by a divisor that nobody
/// knows.
constexpr int64_t unknownRun = int64_t(1) << 30;

// Rough cycles of a thread on a CPU, by which lanes are weighed.
/// Part of the lanes that are live in a loop that they leave one by one.
constexpr double laneUse = 0.6;
constexpr double callCost = 20, rootCost = 6, divisionCost = 8;
/// How much quicker a loop is whose iterations are made lanes.
constexpr double streamGain = 8;
/// The same of a loop that reads what an earlier iteration wrote: a processor
/// has the iterations of several threads in hand at once. First-order filters
/// of 24 elements were 2.3 times slower as lanes, and as quick for 200.
constexpr double recurrenceGain = 2;
/// A lane's share of gathering a number; of doing an operation lane by lane.
constexpr double gatherCost = 1.3, laneCost = 4;
/// The same of gathering up to three numbers outside of loops, or in loops that
/// are unrolled, where a processor has several threads in hand at once, as
/// lanes would: copies in another order were 1.6 to 2 times slower as lanes,
/// springs as much quicker; sums over six neighbours 1.6 times slower.
constexpr double straightGatherCost = 2.8;
/// The same of a number of a row that is loaded with those behind it. Sums over
/// rows of 27 are 1.6 times as fast as lanes, over rows of 195 five times: a
/// processor has several short rows in hand at once.
constexpr double rowCost = 0.8;
/// Elements of a constant table from which lanes choose by selects. A gather
/// takes 0.44 ns a thread at any length; selects 0.20 at 3, 0.23 at 9.
constexpr int64_t selectedElements = 9;
/// Trips of loops that are unrolled.
constexpr int64_t shortLoop = 8;
/// The same in loops that lanes leave one by one: it takes as long for the last
/// lane as for all, while a thread alone gathers no more than it needs; twice
/// that for 64 bits, of which a vector has half as many. Sums over edges of a
/// graph were 1.5 times slower as lanes.
constexpr double divergentGatherCost = 2.4;
/// How long a sum of floats waits for the one before.
constexpr double sumLatency = 4;
/// A call of the device library, which lanes do one by one.
constexpr double searchCost = 500;
/// The same of a field of neighbouring structs, which scalar code finds in one
/// line: bodies of a simulation were 3.6 times slower as lanes.
constexpr double fieldCost = 6;

// Branches of lanes.
/// Arms of more operations than this are worth a branch.
constexpr int64_t longestFlat = 24;
/// Costs of some of their operations.
constexpr int64_t flatCall = 12, flatRoot = 4;

/// Operations that it is worth to compute again to be rid of an atomic addition
/// of an adjoint, be it on a CPU or on a GPU.
constexpr double gatheredAtomic = 64;

} // namespace warp::cost

#endif // WARP_LIB_ANALYSIS_COSTMODEL_H

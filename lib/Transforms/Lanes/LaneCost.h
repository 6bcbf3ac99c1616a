//===- LaneCost.h - Cost and profit of lanes --------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_LANECOST_H
#define WARP_LIB_TRANSFORMS_LANECOST_H

#include "Analysis/ThreadVariance.h"

namespace warp {
class LaneCalls;

/// Rough cycles of one thread, alone and as one of many lanes.
struct LaneCost {
  double scalar = 0, vector = 0;
  /// Results by size, to find out how many lanes a vector has.
  double wide = 0, narrow = 0;
  double operations = 0;
  /// Operations of lanes in the code as it stands.
  int64_t varying = 0;
  bool hasLoop = false;
  /// True if lanes go through rows of their own in a loop.
  bool hasRows = false;
  /// True if most of them are in a loop that two vectors in turn run quicker.
  bool hasChain = false;
  /// The costs of the largest innermost loop, and true if all such loops do
  /// little but compute: four vectors in turn hide how long that takes.
  int64_t largestLoop = 0;
  bool isTight = true;

  /// True if so many lanes of those that there are room for are.
  bool isWorthIt(int64_t lanes, int64_t all) const;
  /// Lanes of vectors of that many bits, one or several at a time.
  int64_t chooseLanes(int64_t bits) const;
};

/// The cost of a thread or of a function. `exclusive`: updates are plain.
/// `calls`: functions that lanes call, if there are any.
LaneCost costOfLanes(mlir::Block &body, const ThreadVariance &variance,
                     bool exclusive, const LaneCalls *calls = nullptr);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_LANECOST_H

//===- UpdateCosts.h - Costs of the updates of a kernel ---------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_UPDATECOSTS_H
#define WARP_LIB_TRANSFORMS_UPDATECOSTS_H

#include "WarpDialect/WarpOps.h"

namespace warp {

/// Cycles of one thread of a kernel on a CPU whose updates have their scopes.
class UpdateCosts {
public:
  /// `operations`: those of a thread, by the estimate of cost. `lanes`: threads
  /// that will be lanes of a vector.
  UpdateCosts(ThreadsOp threads, int64_t operations, int64_t lanes);

  /// True if atomic instructions are left.
  bool any() const { return atomic != plain; }
  /// With updates made plainly, and by atomic instructions.
  double plain = 0, atomic = 0;

private:
  void add(double updates, double share, double plainCost, double atomicCost);

  /// Operations that the estimate has counted for updates.
  double estimated = 0;
};

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_UPDATECOSTS_H

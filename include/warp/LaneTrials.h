//===- LaneTrials.h - Run-time check of vectorised code ---------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LANETRIALS_H
#define WARP_LANETRIALS_H

#include "warp/Export.h"

namespace warp {

/// Has kernels that are compiled for CPUs from now on compare their lanes with
/// scalar code once they have run for a while, and keep the quicker; the
/// default.
WARP_API void setLaneTrials(bool enabled);
WARP_API bool hasLaneTrials();

} // namespace warp

#endif // WARP_LANETRIALS_H

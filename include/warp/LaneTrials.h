//===- LaneTrials.h - Run-time checks of schedules --------------*- C++ -*-===//
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

/// Has kernels that are compiled for GPUs from now on compare their schedules
/// with the plain mapping once they have been launched often, and keep the
/// quicker.
WARP_API void setScheduleTrials(bool enabled);
WARP_API bool hasScheduleTrials();

} // namespace warp

#endif // WARP_LANETRIALS_H

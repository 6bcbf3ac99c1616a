//===- Schedule.h - Launch facts of the compiler and runtime ----*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The launch contract. `LaunchFacts` tell the variants of a kernel apart,
// `CompileOptions` are all that a variant is compiled for, and `Schedule` is how
// launches of its code are made. Members, comparisons and visitors come from
// the records of include/WarpDialect/Launch.td.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_SCHEDULE_H
#define WARP_SCHEDULE_H

#include "warp/ExactSums.h"
#include "warp/PrivateCopies.h"
#include "warp/TensorMaps.h"

#include <cstdint>
#include <string>
#include <vector>

namespace warp {

/// A fact as visitors get it: its name in snake case and, of numbers, the range.
struct FactInfo {
  const char *name;
  int64_t least, most;
  /// Powers of two, and 0 if that is `least`.
  bool isPower;

  bool allows(int64_t value) const {
    return value >= least && value <= most &&
           !(isPower && (value & (value - 1)) != 0);
  }
};

#define GET_LAUNCH_STRUCTS
#include "warp/LaunchContract.h.inc"

} // namespace warp

#endif // WARP_SCHEDULE_H

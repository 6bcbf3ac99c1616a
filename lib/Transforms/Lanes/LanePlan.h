//===- LanePlan.h - Choice of lanes and their width -------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_LANEPLAN_H
#define WARP_LIB_TRANSFORMS_LANEPLAN_H

#include "Analysis/ThreadVariance.h"

#include <string>

namespace warp {
class LaneCalls;

struct LanePlan {
  /// 1: threads stay scalar.
  int64_t lanes = 1;
  /// The reason of that choice.
  std::string reason;
  /// True if the first lane has to have an index in the last dimension that is
  /// a multiple of the lanes: they share values then.
  bool isAligned = false;
  /// True if another length of the launch's rows may decide otherwise.
  bool dependsOnRows = false;
  /// True if it matters how far apart the rows are that lanes go through.
  bool dependsOnFarRows = false;
  /// True if launches of a few threads have none.
  bool dependsOnFew = false;
};

/// On `warp.threads` with lanes: the index of the first is a multiple of them.
constexpr llvm::StringLiteral alignedAttr = "warp.aligned";

/// Why the threads of a kernel that come to some code cannot be lanes; empty if
/// they can.
std::string whyNotLanes(mlir::Region &body, const ThreadVariance &variance,
                        mlir::FunctionOpInterface kernel);

/// As many lanes as the variant asks for, if it does and they are possible at
/// all. `calls`: functions that lanes call, if there are any.
LanePlan planLanes(mlir::FunctionOpInterface kernel, ThreadsOp threads,
                   const ThreadVariance &variance,
                   const LaneCalls *calls = nullptr);

/// True if the elements of an array's last dimension follow each other, and are
/// a few numbers of one type each, so that lanes can load them as vectors.
bool hasDenseElements(mlir::Value array);

/// True if it is an array of structs without gaps, or one field or component of
/// such elements.
bool isPartOfPacked(mlir::Value array);

/// Accesses arrays themselves instead of views of them, whose start may differ
/// from thread to thread.
void foldViews(mlir::FunctionOpInterface kernel);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_LANEPLAN_H

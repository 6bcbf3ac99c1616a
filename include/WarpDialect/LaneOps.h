//===- LaneOps.h - Threads that meet ----------------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARPDIALECT_LANEOPS_H
#define WARPDIALECT_LANEOPS_H

#include "WarpDialect/WarpOps.h"

namespace warp::attr {
/// On a load of lanes: it is of so many elements that follow each other in the
/// last dimension, each a component.
constexpr llvm::StringLiteral run = "warp.run";
} // namespace warp::attr

#define GET_OP_CLASSES
#include "WarpDialect/WarpLaneOps.h.inc"

#endif // WARPDIALECT_LANEOPS_H

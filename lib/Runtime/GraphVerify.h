//===- GraphVerify.h - Comparison of two orders of a graph ------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_GRAPHVERIFY_H
#define WARP_LIB_RUNTIME_GRAPHVERIFY_H

#include "GraphTrace.h"

#include <functional>

namespace warp {

/// Runs a graph as it was recorded and then, with the memory that it had
/// before, in the order of its schedule. Throws unless both leave the same
/// bytes. A graph with a node that may touch anything runs as recorded.
void runBothOrders(int device, const GraphTrace &trace,
                   const std::function<void()> &recorded,
                   const std::function<void()> &ordered);

} // namespace warp

#endif // WARP_LIB_RUNTIME_GRAPHVERIFY_H

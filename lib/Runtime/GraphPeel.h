//===- GraphPeel.h - Loop peeling: loops that run at least once -*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_GRAPHPEEL_H
#define WARP_LIB_RUNTIME_GRAPHPEEL_H

#include "GraphTrace.h"

#include <vector>

namespace warp {

/// True if a loop runs at least once, whose condition the last of `calls` sets:
/// a fill has written a value with which it holds, and nothing since may have
/// written another one.
bool runsOnce(const GraphTrace &trace, const std::vector<GraphStep> &calls);

/// True if the calls of a body follow each other, and the last one sets the
/// condition again that the call `setter` sets.
bool isTurn(const GraphTrace &trace, const std::vector<GraphStep> &body,
            const GraphStep &setter);

} // namespace warp

#endif // WARP_LIB_RUNTIME_GRAPHPEEL_H

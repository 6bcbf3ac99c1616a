//===- Operations.h - Operations of saved graphs ----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_GRAPHS_OPERATIONS_H
#define WARP_LIB_GRAPHS_OPERATIONS_H

#include "Runtime/GraphOperations.h"
#include "warp/Graph.h"

#include <cstdint>
#include <map>

namespace warp::graphs {

/// Conditions of a graph that is captured again, by their number.
using Conditions = std::map<uint32_t, Capture::Condition>;

class Geometry;

/// Does it again, on a device, while `capture` records.
void repeat(GraphOperation &operation, int device, int blockDim,
            const Stream *stream, Capture &capture, Conditions &conditions,
            const Geometry &geometry);

} // namespace warp::graphs

#endif // WARP_LIB_GRAPHS_OPERATIONS_H

//===- GraphClone.h - Inlining of conditional child graphs ------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The driver makes no child of a graph that has conditional nodes, so the nodes
// of such a graph are added to the outer one in its place.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_CUDA_GRAPHCLONE_H
#define WARP_LIB_RUNTIME_CUDA_GRAPHCLONE_H

#include "GraphDriver.h"

#include <vector>

namespace warp::cuda {

/// A branch or loop of a graph; the driver does not say what it was made of.
struct Conditional {
  ConditionHandle handle;
  bool loop;
  GraphHandle body;
};

/// Adds a conditional node to a graph that is being captured on a device, and
/// remembers what it is as long as a graph has it.
GraphNode addConditional(int device, GraphHandle graph, const GraphNode *after,
                         size_t count, Conditional &conditional);

/// The body of a conditional node.
GraphHandle bodyOf(GraphNode node);

/// True if a graph has branches or loops.
bool hasConditionals(GraphHandle graph);

/// The nodes of a graph, in no particular order.
std::vector<GraphNode> nodesOf(GraphHandle graph);

/// CUgraphNodeType of a node.
int typeOf(GraphNode node);

/// The nodes of a graph that no other one waits for.
std::vector<GraphNode> lastNodes(GraphHandle graph);

/// Adds copies of a graph's nodes to another one, behind given nodes of that.
/// `setter` is the kernel that sets handles, its first argument. Returns the
/// copies that no other one waits for. Throws for nodes that have no copy.
std::vector<GraphNode> cloneNodes(int device, GraphHandle source,
                                  GraphHandle target,
                                  const std::vector<GraphNode> &after,
                                  Function setter);

} // namespace warp::cuda

#endif // WARP_LIB_RUNTIME_CUDA_GRAPHCLONE_H

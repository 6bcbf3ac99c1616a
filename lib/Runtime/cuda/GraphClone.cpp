//===- GraphClone.cpp - Inlining of conditional child graphs --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Copies have new handles of conditions, since a handle belongs to one graph;
// the kernels that set them get the new ones as arguments. A kernel that sets a
// handle comes before the node of that handle or is in its body, so a handle is
// made where it is first met.
//
//===----------------------------------------------------------------------===//

#include "GraphClone.h"

#include "Device.h"
#include "GraphImpl.h"
#include "warp/Forks.h"

#include <algorithm>
#include <map>

using namespace warp;
using namespace warp::cuda;

//===----------------------------------------------------------------------===//
// Branches and loops by their node
//===----------------------------------------------------------------------===//

namespace {
struct Conditionals {
  ForkMutex mutex;
  std::map<GraphNode, Conditional> known;
};
} // namespace

static Conditionals &conditionals() {
  static auto *instance = new Conditionals;
  return *instance;
}

static ConditionHandle createHandle(int device, GraphHandle graph) {
  ConditionHandle handle = 0;
  WARP_CUDA_GRAPH(createCondition, &handle, graph, contextOf(device), 0, 0);
  return handle;
}

GraphNode cuda::addConditional(int device, GraphHandle graph,
                               const GraphNode *after, size_t count,
                               Conditional &conditional) {
  ConditionalNode description;
  description.handle = conditional.handle;
  description.kind = conditional.loop;
  description.context = contextOf(device);
  GraphNode node = nullptr;
  WARP_CUDA_GRAPH(addNode, &node, graph, after, count, &description);
  conditional.body = description.bodies[0];
  {
    std::lock_guard lock(conditionals().mutex);
    conditionals().known[node] = conditional;
  }
  keepForCapture(device, [node] {
    std::lock_guard lock(conditionals().mutex);
    conditionals().known.erase(node);
  });
  return node;
}

static Conditional conditionalOf(GraphNode node) {
  std::lock_guard lock(conditionals().mutex);
  auto entry = conditionals().known.find(node);
  if (entry == conditionals().known.end())
    throw Error(Error::Kind::Runtime,
                "a graph with branches of another library cannot be part of "
                "a graph");
  return entry->second;
}

GraphHandle cuda::bodyOf(GraphNode node) { return conditionalOf(node).body; }

/// All nodes that a function of the driver gives, which says first how many.
template <typename Query> static std::vector<GraphNode> allNodes(Query query) {
  size_t count = 0;
  query(nullptr, &count);
  std::vector<GraphNode> nodes(count);
  if (count)
    query(nodes.data(), &count);
  return nodes;
}

std::vector<GraphNode> cuda::nodesOf(GraphHandle graph) {
  return allNodes([&](GraphNode *nodes, size_t *count) {
    WARP_CUDA_GRAPH(getNodes, graph, nodes, count);
  });
}

/// The driver says nothing of edges with data unless it may say the data, too.
static void edgesOf(GraphHandle graph, GraphNode *from, GraphNode *to,
                    size_t *count) {
  if (!graphDriver().allEdges)
    return WARP_CUDA_GRAPH(getEdges, graph, from, to, count);
  std::vector<EdgeData> data(from ? *count : 0);
  WARP_CUDA_GRAPH(allEdges, graph, from, to, from ? data.data() : nullptr,
                  count);
}

std::vector<GraphNode> cuda::lastNodes(GraphHandle graph) {
  size_t edges = 0;
  edgesOf(graph, nullptr, nullptr, &edges);
  std::vector<GraphNode> from(edges), to(edges), nodes = nodesOf(graph);
  if (edges)
    edgesOf(graph, from.data(), to.data(), &edges);
  std::sort(from.begin(), from.end());
  nodes.erase(std::remove_if(nodes.begin(), nodes.end(),
                             [&](GraphNode node) {
                               return std::binary_search(from.begin(),
                                                         from.end(), node);
                             }),
              nodes.end());
  return nodes;
}

int cuda::typeOf(GraphNode node) {
  int type = 0;
  WARP_CUDA_GRAPH(nodeType, node, &type);
  return type;
}

bool cuda::hasConditionals(GraphHandle graph) {
  {
    std::lock_guard lock(conditionals().mutex);
    if (conditionals().known.empty())
      return false;
  }
  std::vector<GraphNode> nodes = nodesOf(graph);
  return std::any_of(nodes.begin(), nodes.end(), [](GraphNode node) {
    return typeOf(node) == nodeConditional;
  });
}

//===----------------------------------------------------------------------===//
// Copies
//===----------------------------------------------------------------------===//

namespace {

class Cloner {
public:
  Cloner(int device, Function setter) : device(device), setter(setter) {}

  std::vector<GraphNode> clone(GraphHandle source, GraphHandle target,
                               const std::vector<GraphNode> &after);

private:
  GraphNode copy(GraphNode node, GraphHandle target,
                 const std::vector<GraphNode> &after);
  GraphNode copyKernel(GraphNode node, GraphHandle target,
                       const std::vector<GraphNode> &after);
  GraphNode copyConditional(GraphNode node, GraphHandle target,
                            const std::vector<GraphNode> &after);
  ConditionHandle handleFor(ConditionHandle handle, GraphHandle target);

  int device;
  Function setter;
  std::map<ConditionHandle, ConditionHandle> handles;
};

} // namespace

static std::vector<GraphNode> dependenciesOf(GraphNode node) {
  return allNodes([&](GraphNode *nodes, size_t *count) {
    if (!graphDriver().allDependencies)
      return WARP_CUDA_GRAPH(nodeDependencies, node, nodes, count);
    std::vector<EdgeData> data(nodes ? *count : 0);
    WARP_CUDA_GRAPH(allDependencies, node, nodes, nodes ? data.data() : nullptr,
                    count);
  });
}

ConditionHandle Cloner::handleFor(ConditionHandle handle, GraphHandle target) {
  auto [entry, isNew] = handles.try_emplace(handle);
  if (isNew)
    entry->second = createHandle(device, target);
  return entry->second;
}

GraphNode Cloner::copyKernel(GraphNode node, GraphHandle target,
                             const std::vector<GraphNode> &after) {
  KernelNode kernel;
  WARP_CUDA_GRAPH(kernelParams, node, &kernel);
  void *arguments[3];
  ConditionHandle handle;
  if (kernel.function == setter) {
    std::copy(kernel.arguments, kernel.arguments + 3, arguments);
    handle = handleFor(*static_cast<ConditionHandle *>(arguments[0]), target);
    arguments[0] = &handle;
    kernel.arguments = arguments;
  }
  GraphNode made = nullptr;
  WARP_CUDA_GRAPH(addKernel, &made, target, after.data(), after.size(),
                  &kernel);
  WARP_CUDA_GRAPH(copyAttributes, made, node);
  return made;
}

GraphNode Cloner::copyConditional(GraphNode node, GraphHandle target,
                                  const std::vector<GraphNode> &after) {
  Conditional found = conditionalOf(node), made = found;
  made.handle = handleFor(found.handle, target);
  GraphNode result =
      addConditional(device, target, after.data(), after.size(), made);
  clone(found.body, made.body, {});
  return result;
}

GraphNode Cloner::copy(GraphNode node, GraphHandle target,
                       const std::vector<GraphNode> &after) {
  GraphNode made = nullptr;
  switch (typeOf(node)) {
  case nodeKernel:
    return copyKernel(node, target, after);
  case nodeConditional:
    return copyConditional(node, target, after);
  case nodeCopy: {
    CopyNode params;
    WARP_CUDA_GRAPH(copyParams, node, &params);
    WARP_CUDA_GRAPH(addCopy, &made, target, after.data(), after.size(), &params,
                    contextOf(device));
    return made;
  }
  case nodeFill: {
    FillNode params;
    WARP_CUDA_GRAPH(fillParams, node, &params);
    WARP_CUDA_GRAPH(addFill, &made, target, after.data(), after.size(), &params,
                    contextOf(device));
    return made;
  }
  case nodeGraph: {
    GraphHandle child = nullptr;
    WARP_CUDA_GRAPH(childGraph, node, &child);
    WARP_CUDA_GRAPH(addChild, &made, target, after.data(), after.size(), child);
    return made;
  }
  case nodeEmpty:
    WARP_CUDA_GRAPH(addEmpty, &made, target, after.data(), after.size());
    return made;
  case nodeWait: {
    EventHandle event = nullptr;
    WARP_CUDA_GRAPH(waitNodeEvent, node, &event);
    WARP_CUDA_GRAPH(addWait, &made, target, after.data(), after.size(), event);
    return made;
  }
  case nodeRecord: {
    EventHandle event = nullptr;
    WARP_CUDA_GRAPH(recordNodeEvent, node, &event);
    WARP_CUDA_GRAPH(addRecord, &made, target, after.data(), after.size(),
                    event);
    return made;
  }
  default:
    throw Error(Error::Kind::Runtime,
                "a graph with branches or loops that calls the host cannot be "
                "part of a graph");
  }
}

std::vector<GraphNode> Cloner::clone(GraphHandle source, GraphHandle target,
                                     const std::vector<GraphNode> &after) {
  std::vector<GraphNode> left = nodesOf(source), leaves;
  std::map<GraphNode, GraphNode> copies;
  // Nodes come in no particular order; each round adds those whose
  // predecessors are there.
  while (!left.empty()) {
    std::vector<GraphNode> later;
    for (GraphNode node : left) {
      std::vector<GraphNode> before = dependenciesOf(node);
      if (!std::all_of(before.begin(), before.end(),
                       [&](GraphNode one) { return copies.count(one) != 0; })) {
        later.push_back(node);
        continue;
      }
      for (GraphNode &one : before) {
        one = copies.at(one);
        leaves.erase(std::remove(leaves.begin(), leaves.end(), one),
                     leaves.end());
      }
      leaves.push_back(copies[node] =
                           copy(node, target, before.empty() ? after : before));
    }
    left = std::move(later);
  }
  return leaves.empty() ? after : leaves;
}

std::vector<GraphNode> cuda::cloneNodes(int device, GraphHandle source,
                                        GraphHandle target,
                                        const std::vector<GraphNode> &after,
                                        Function setter) {
  const GraphDriver &driver = graphDriver();
  if (!driver.nodeType || !driver.nodeDependencies || !driver.kernelParams ||
      !driver.addKernel || !driver.copyAttributes || !driver.copyParams ||
      !driver.addCopy || !driver.fillParams || !driver.addFill ||
      !driver.childGraph || !driver.addEmpty)
    throw Error(Error::Kind::Runtime,
                "the CUDA driver cannot copy graphs with branches");
  return Cloner(device, setter).clone(source, target, after);
}

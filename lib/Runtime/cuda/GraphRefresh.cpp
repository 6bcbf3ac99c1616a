//===- GraphRefresh.cpp - Tier-1 code for captured launches ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The driver updates an executable graph to a graph of the same topology, so
// the functions of kernel nodes are exchanged in the graph first, those of
// bodies and child graphs too. Tiers of a variant have one schedule, and so
// the same grid and arguments.
//
//===----------------------------------------------------------------------===//

#include "GraphRefresh.h"

#include "GraphClone.h"
#include "Kernel.h"

using namespace warp;
using namespace warp::cuda;

bool cuda::canRefreshGraphs() {
  const GraphDriver &driver = graphDriver();
  return driver.kernelParams && driver.setKernelParams && driver.updateExec &&
         driver.parameterInfo && driver.nodeType && driver.childGraph;
}

bool ProvisionalNodes::areReady() {
  while (next < launches.size() &&
         !launches[next].variant->isQuick.load(std::memory_order_acquire))
    ++next;
  return next == launches.size() && !launches.empty();
}

/// Gives a kernel node another function. The driver owns the arguments that it
/// returns until they are replaced, so they are copied.
static void setFunction(GraphNode node, KernelNode params, Function function) {
  size_t offset = 0, bytes = 0;
  WARP_CUDA_GRAPH(parameterInfo, params.function, 0, &offset, &bytes);
  auto *argument = static_cast<const char *>(params.arguments[0]);
  std::vector<char> copied(argument, argument + bytes);
  void *arguments[] = {copied.data()};
  params.arguments = arguments;
  params.function = function;
  params.kernel = nullptr;
  WARP_CUDA_GRAPH(setKernelParams, node, &params);
}

void ProvisionalNodes::exchange(GraphHandle graph, const Functions &functions) {
  for (GraphNode node : nodesOf(graph)) {
    switch (typeOf(node)) {
    case nodeKernel: {
      KernelNode params;
      WARP_CUDA_GRAPH(kernelParams, node, &params);
      auto found = functions.find(params.function);
      if (found != functions.end() && params.arguments)
        setFunction(node, params, found->second);
      break;
    }
    case nodeConditional:
      exchange(bodyOf(node), functions);
      break;
    case nodeGraph: {
      GraphHandle child = nullptr;
      WARP_CUDA_GRAPH(childGraph, node, &child);
      exchange(child, functions);
      break;
    }
    default:
      break;
    }
  }
}

void ProvisionalNodes::exchange(GraphHandle graph, GraphExec exec) {
  Functions functions;
  for (const ProvisionalLaunch &launch : launches) {
    Function before = functionOf(*launch.code);
    Function after = functionOf(*launch.variant->current.load());
    if (before != after)
      functions[before] = after;
  }
  try {
    exchange(graph, functions);
    UpdateResult result;
    WARP_CUDA_GRAPH(updateExec, exec, graph, &result);
    launches.clear();
  } catch (const Error &) {
    // The graph keeps its code.
  }
}

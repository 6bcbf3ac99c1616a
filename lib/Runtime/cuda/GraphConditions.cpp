//===- GraphConditions.cpp - Branches and loops of CUDA graphs ------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A branch or loop is a conditional node. A kernel of one thread, here as PTX,
// reads the condition array and sets the node's handle; the driver provides
// the function that it calls. To fill the body the capture of the outer graph
// is ended, the same stream captures into the body's graph, and then the outer
// capture is resumed behind the new node: launches in the body need not know
// where they go.
//
// The first turn of a loop that runs at least once (GraphPeel.cpp) is copied in
// front of the loop. Its last kernel sets the handle, so that the one which
// sets it first goes away.
//
//===----------------------------------------------------------------------===//

#include "CudaGraph.h"
#include "Device.h"
#include "Runtime/GraphPeel.h"
#include "Runtime/LaunchQueue.h"
#include "warp/Fusion.h"

#include <algorithm>
#include <map>

using namespace warp;

/// Nodes of a body that is copied, at most: the start of a longer one takes
/// little of its time.
static constexpr size_t mostTurnNodes = 256;

/// Sets a handle to whether an int32 is not zero, or is zero.
static const char *const conditionCode = R"(
.version 6.4
.target sm_70
.address_size 64
.extern .func cudaGraphSetConditional(.param .b64 handle, .param .b32 value);
.visible .entry warp_set_condition(
  .param .u64 handle, .param .u64 address, .param .u32 negated)
{
  .reg .pred %p;
  .reg .b32 %value, %negated;
  .reg .b64 %handle, %address;
  ld.param.u64 %handle, [handle];
  ld.param.u64 %address, [address];
  ld.param.u32 %negated, [negated];
  cvta.to.global.u64 %address, %address;
  ld.global.u32 %value, [%address];
  setp.ne.u32 %p, %value, 0;
  selp.u32 %value, 1, 0, %p;
  xor.b32 %value, %value, %negated;
  {
    .param .b64 first;
    .param .b32 second;
    st.param.b64 [first], %handle;
    st.param.b32 [second], %value;
    call.uni cudaGraphSetConditional, (first, second);
  }
  ret;
}
)";

cuda::Function cuda::conditionKernel(int device) {
  static ForkMutex mutex;
  static auto *functions = new std::map<int, cuda::Function>;
  std::lock_guard lock(mutex);
  cuda::Function &function = (*functions)[device];
  if (function)
    return function;
  cuda::RelaxedCaptures relaxed;
  cuda::ModuleHandle module;
  WARP_CUDA(moduleLoadDataEx, &module, conditionCode, 0, nullptr, nullptr);
  WARP_CUDA(moduleGetFunction, &function, module, "warp_set_condition");
  return function;
}

Capture::Condition CudaCapture::addCondition(const int32_t *value,
                                             bool negated) {
  if (!supportsConditionalGraphs())
    throw captureError(device(),
                       "branches and loops need a CUDA driver of version 12.4 "
                       "or newer");
  cuda::ContextScope scope(device());
  Position position(raw());
  cuda::ConditionHandle handle = 0;
  WARP_CUDA_GRAPH(createCondition, &handle, position.graph,
                  cuda::contextOf(device()), 0, 0);
  GraphStep step = beginStep(stream.get());
  setCondition(handle, value, negated);
  if (trace())
    trace()->addCondition(handle, value, negated);
  endStep(std::move(step), stream.get());
  return handle;
}

void CudaCapture::updateCondition(Condition condition, const int32_t *value,
                                  bool negated) {
  drainLaunches();
  GraphStep step = beginStep(stream.get());
  setCondition(condition, value, negated);
  if (trace())
    trace()->updateCondition(condition, value, negated);
  endStep(std::move(step), stream.get());
}

void CudaCapture::setCondition(Condition condition, const int32_t *value,
                               bool negated) {
  cuda::ContextScope scope(device());
  unsigned flip = negated;
  void *arguments[] = {&condition, &value, &flip};
  WARP_CUDA(launchKernel, cuda::conditionKernel(device()), 1, 1, 1, 1, 1, 1, 0,
            raw(), arguments, nullptr);
}

void CudaCapture::beginBody(Condition condition, bool loop) {
  cuda::ContextScope scope(device());
  Position position(raw());
  cuda::Conditional made{condition, loop, nullptr};
  Paused outer{position.graph, nullptr, nullptr, beginStep(stream.get())};
  outer.node = cuda::addConditional(
      device(), position.graph, position.dependencies, position.count, made);
  position.set(raw(), outer.node);
  outer.graph = stop();
  outer.body = made.body;
  outer.step.after = {outer.node};
  paused.push_back(std::move(outer));
  WARP_CUDA_GRAPH(beginCaptureTo, raw(), made.body, nullptr, nullptr, 0, mode);
  noteGraph();
  if (trace())
    trace()->beginBody(condition, loop);
}

/// True if all nodes of a body have copies; branches in it would double with
/// each body around them.
static bool mayCopy(GraphHandle body) {
  if (!cuda::canCopyNodes() || !cuda::graphDriver().addEdges ||
      !cuda::graphDriver().destroyNode)
    return false;
  std::vector<GraphNode> nodes = cuda::nodesOf(body);
  return nodes.size() <= mostTurnNodes &&
         std::all_of(nodes.begin(), nodes.end(), [](GraphNode node) {
           int type = cuda::typeOf(node);
           return type == cuda::nodeKernel || type == cuda::nodeCopy ||
                  type == cuda::nodeFill;
         });
}

/// Copies the first turn of a loop in front of it, if there surely is one.
void CudaCapture::peelTurn(Paused &outer) {
  std::vector<GraphStep> &calls = *(trace()->steps.end() - 2);
  const std::vector<GraphStep> &turn = trace()->steps.back();
  cuda::Conditional loop = cuda::conditionalOf(outer.node);
  if (!loop.loop || calls.empty() || calls.back().after != outer.step.before ||
      !isTurn(*trace(), turn, calls.back()) || !runsOnce(*trace(), calls) ||
      !mayCopy(loop.body))
    return;
  GraphStep setter = std::move(calls.back());
  calls.pop_back();
  auto handles = [](const std::vector<NodeId> &nodes) {
    std::vector<GraphNode> list;
    for (NodeId node : nodes)
      list.push_back(static_cast<GraphNode>(const_cast<void *>(node)));
    return list;
  };
  std::map<GraphNode, GraphNode> copies =
      cuda::copyBody(device(), loop, outer.graph, handles(setter.before),
                     cuda::conditionKernel(device()));
  auto copiesOf = [&](const std::vector<NodeId> &nodes) {
    std::vector<NodeId> list;
    for (GraphNode node : handles(nodes))
      list.push_back(copies.at(node));
    return list;
  };
  for (const GraphStep &call : turn)
    calls.push_back(
        {call.first, call.last,
         call.before.empty() ? setter.before : copiesOf(call.before),
         copiesOf(call.after)});
  for (GraphNode node : handles(setter.after))
    WARP_CUDA_GRAPH(destroyNode, node);
  outer.step.before = calls.back().after;
  outer.step.isPeeled = true;
  for (GraphNode last : handles(outer.step.before)) {
    cuda::EdgeData data;
    WARP_CUDA_GRAPH(addEdges, outer.graph, &last, &outer.node, &data, 1);
  }
}

void CudaCapture::endBody() {
  if (paused.empty())
    throw captureError(device(), "no body of a graph is open");
  drainLaunches();
  stop();
  Paused outer = std::move(paused.back());
  cuda::ContextScope scope(device());
  if (order == NodeOrder::Dependencies && fusesLaunches())
    peelTurn(outer);
  if (order != NodeOrder::Recorded)
    rewriter.addBody(
        outer.node,
        rewriter.rewrite(outer.body, *trace(), trace()->steps.back(), *stream));
  WARP_CUDA_GRAPH(beginCaptureTo, raw(), outer.graph, &outer.node, nullptr, 1,
                  mode);
  paused.pop_back();
  noteGraph();
  if (trace())
    trace()->endBody();
  endStep(std::move(outer.step), stream.get());
}

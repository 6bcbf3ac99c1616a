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
//===----------------------------------------------------------------------===//

#include "CudaGraph.h"
#include "Device.h"
#include "Runtime/LaunchQueue.h"

#include <map>

using namespace warp;

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

void CudaCapture::endBody() {
  if (paused.empty())
    throw captureError(device(), "no body of a graph is open");
  drainLaunches();
  stop();
  Paused outer = std::move(paused.back());
  cuda::ContextScope scope(device());
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

//===- GraphCapture.cpp - Captures of CUDA streams as graphs --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The driver records what is queued on the capturing stream. Memory that is
// allocated meanwhile is ordinary memory, made on a stream of its own (see
// Memory.cpp), so that arrays born in a capture can be used like any other
// before the first replay and between replays.
//
//===----------------------------------------------------------------------===//

#include "CudaGraph.h"
#include "Device.h"
#include "Runtime/LaunchQueue.h"

using namespace warp;

void CudaCapture::start() {
  if (!external) {
    cuda::ContextScope scope(device());
    WARP_CUDA_GRAPH(beginCapture, raw(), mode);
  }
  running = true;
  noteGraph();
}

void CudaCapture::noteGraph() {
  current = nullptr;
  if (!cuda::graphDriver().captureInfo)
    return;
  cuda::ContextScope scope(device());
  current = Position(raw()).graph;
}

/// The stream that work is queued on where none is named.
static StreamHandle handleOf(int device, const Stream *stream) {
  return static_cast<StreamHandle>(stream ? stream->handle()
                                          : currentStream(device)->handle());
}

bool CudaCapture::records(const Stream *other) const {
  if (!current)
    return true;
  // The caller has a lock, and has looked at the stream before.
  BehindNothing exempt;
  cuda::ContextScope scope(device());
  return Position(handleOf(device(), other)).graph == current;
}

std::vector<NodeId> CudaCapture::position(const Stream *other) const {
  if (!current)
    return {};
  cuda::ContextScope scope(device());
  Position found(handleOf(device(), other));
  return std::vector<NodeId>(found.dependencies,
                             found.dependencies + found.count);
}

/// Ends the driver's capture and reports what went wrong.
GraphHandle CudaCapture::stop() {
  cuda::ContextScope scope(device());
  GraphHandle graph = nullptr;
  cuda::Result result = cuda::graphDriver().endCapture(raw(), &graph);
  if (result == cuda::success && graph)
    return graph;
  running = false;
  switch (result) {
  case cuda::errorCaptureUnjoined:
    throw captureError(device(),
                       "work on another stream was not joined, let the "
                       "captured stream wait for it");
  case cuda::success:
  case cuda::errorCaptureInvalidated:
  case cuda::errorCaptureUnsupported:
  case cuda::errorCaptureImplicit:
    throw captureError(device(),
                       "something was done that a graph cannot hold, such as "
                       "waiting for the device or work on the legacy stream");
  default:
    cuda::raise(result, "cuStreamEndCapture");
  }
}

CudaCapture::~CudaCapture() {
  // Launches that wait belong to the graph, not behind it.
  drainLaunches();
  std::shared_ptr<Kept> kept = close();
  if (external || !running)
    return;
  try {
    cuda::ContextScope scope(device());
    GraphHandle graph = nullptr;
    cuda::Result result = cuda::graphDriver().endCapture(raw(), &graph);
    // The graphs of bodies belong to the one around them. Where the driver
    // threw a body away itself, destroying what is around it would crash.
    if (result == cuda::success && !paused.empty())
      graph = paused.front().graph;
    if (result == cuda::success && graph)
      cuda::graphDriver().destroy(graph);
  } catch (const Error &) {
  }
}

std::shared_ptr<Graph> CudaCapture::end() {
  finishLaunches();
  if (!running)
    throw captureError(device(), "it has ended already");
  if (!paused.empty())
    throw captureError(device(), "it ends inside of a branch or loop");
  if (external) {
    running = false;
    auto result =
        std::make_shared<CudaGraph>(device(), nullptr, nullptr, close());
    handTrace(*result);
    return result;
  }
  // Also behind what streams did that began behind the captured one, and that
  // nobody has joined.
  if (cuda::graphDriver().captureInfo && cuda::graphDriver().getEdges) {
    cuda::ContextScope scope(device());
    Position position(raw());
    if (position.graph)
      position.set(raw(), cuda::lastNodes(position.graph));
  }
  GraphHandle graph = stop();
  running = false;
  cuda::ContextScope scope(device());
  cuda::RelaxedCaptures relaxed;
  std::shared_ptr<const GraphSchedule> schedule;
  cuda::GraphExec recorded = nullptr;
  bool isVerified = order == NodeOrder::Verified;
  if (isVerified && cuda::hasConditionals(graph)) {
    // The driver makes one executable alone of such a graph.
    isVerified = false;
    schedule = cuda::keptSchedule(
        "graphs with branches or loops have one executable form on GPUs, so "
        "two orders cannot be compared");
  } else if (order != NodeOrder::Recorded) {
    if (isVerified)
      recorded = instantiate(graph, schedule);
    schedule =
        rewriter.rewrite(graph, *trace(), trace()->steps.front(), *stream);
  }
  cuda::GraphExec exec = instantiate(graph, schedule);
  // Fused launches have been noted like those that were recorded.
  std::shared_ptr<Kept> kept = close();
  kept->insert(kept->end(), rewriter.kernels.begin(), rewriter.kernels.end());
  auto made = std::make_shared<CudaGraph>(device(), graph, exec,
                                          std::move(kept), takeProvisional());
  made->recorded = recorded;
  handTrace(*made);
  handSchedule(*made, std::move(schedule));
  return made;
}

cuda::GraphExec
CudaCapture::instantiate(GraphHandle graph,
                         std::shared_ptr<const GraphSchedule> &schedule) {
  cuda::GraphExec exec = nullptr;
  cuda::Result result = cuda::graphDriver().instantiate(&exec, graph, 0);
  if (result != cuda::success && rewriter.hasChanges()) {
    if (std::string why = rewriter.undo(); !why.empty())
      schedule = cuda::keptSchedule(why);
    result = cuda::graphDriver().instantiate(&exec, graph, 0);
  }
  if (result != cuda::success) {
    cuda::graphDriver().destroy(graph);
    cuda::check(result, "cuGraphInstantiateWithFlags");
  }
  return exec;
}

//===- Graph.cpp - Graphs of CUDA devices: replay, graphs in captures -----===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A graph with branches or loops that another capture launches is copied into
// that one (GraphClone.cpp); any other becomes a node.
//
//===----------------------------------------------------------------------===//

#include "CudaGraph.h"

#include "Device.h"
#include "GraphVerify.h"
#include "Runtime/LaunchQueue.h"

using namespace warp;

static std::string aliasOf(int device) { return deviceInfo(device).alias; }

Error warp::captureError(int device, const std::string &problem) {
  return Error(Error::Kind::Runtime,
               "graph capture on '" + aliasOf(device) + "': " + problem);
}

CudaGraph::~CudaGraph() {
  // A destructor has nobody to tell what the driver refuses.
  try {
    cuda::ContextScope scope(device());
    cuda::RelaxedCaptures relaxed;
    // Memory that the graph keeps must not go while it runs.
    if (exec && !kept->empty() && !isCapturing(device()))
      cuda::driver()->ctxSynchronize();
    for (cuda::GraphExec one : {exec, recorded})
      if (one)
        cuda::graphDriver().destroyExec(one);
    if (graph)
      cuda::graphDriver().destroy(graph);
  } catch (const Error &) {
  }
}

void CudaGraph::checkOwned(const char *what) const {
  if (!graph)
    throw captureError(device(), std::string("cannot ") + what +
                                     " a graph whose capture was begun by "
                                     "somebody else");
}

/// Makes this graph a node of the one that a stream is captured into, or adds
/// its nodes to that.
bool CudaGraph::addToCapture(StreamHandle stream) const {
  int capturing = 0;
  WARP_CUDA(streamIsCapturing, stream, &capturing);
  if (!capturing)
    return false;
  if (!cuda::graphDriver().captureInfo || !cuda::graphDriver().addChild)
    throw captureError(device(), "the CUDA driver has no graphs in graphs");
  Position position(stream);
  keepForCapture(device(), [kept = kept] {});
  for (const ProvisionalLaunch &launch : provisional.all())
    noteProvisional(device(), launch);
  if (cuda::hasConditionals(graph)) {
    std::vector<GraphNode> after(position.dependencies,
                                 position.dependencies + position.count);
    position.set(stream,
                 cuda::cloneNodes(device(), graph, position.graph, after,
                                  cuda::conditionKernel(device())));
    return true;
  }
  GraphNode node;
  WARP_CUDA_GRAPH(addChild, &node, position.graph, position.dependencies,
                  position.count, graph);
  position.set(stream, node);
  return true;
}

void CudaGraph::takeBetterCode() {
  std::lock_guard lock(refreshing);
  if (!isProvisional || !provisional.areReady())
    return;
  provisional.exchange(graph, exec);
  isProvisional = false;
}

void CudaGraph::launch(const Stream *stream) {
  checkOwned("launch");
  TraceScope tracing(device(), stream);
  if (tracing)
    tracing->addGraph(*this);
  QueuedWork work(device(), stream);
  if (capturesInProgress && addToCapture(work.stream()))
    return;
  if (isProvisional.load(std::memory_order_acquire))
    takeBetterCode();
  auto run = [&](cuda::GraphExec which) {
    WARP_CUDA_GRAPH(launch, which, work.stream());
  };
  if (!recorded)
    return run(exec);
  synchronizeDevice(device());
  runBothOrders(
      device(), *operations(), [&] { run(recorded); }, [&] { run(exec); });
}

size_t CudaGraph::size() const {
  if (!graph)
    return 0;
  size_t count = 0;
  WARP_CUDA_GRAPH(getNodes, graph, nullptr, &count);
  return count;
}

void CudaGraph::writeDot(const std::string &path, bool verbose) const {
  checkOwned("print");
  if (!cuda::graphDriver().writeDot)
    throw captureError(device(), "the driver cannot print graphs");
  cuda::ContextScope scope(device());
  WARP_CUDA_GRAPH(writeDot, graph, path.c_str(),
                  verbose ? cuda::dotVerbose : 0);
}

std::unique_ptr<CaptureBase>
CudaDevice::beginCapture(std::shared_ptr<Stream> stream, CaptureMode mode,
                         bool external) {
  finishLaunches();
  if (!stream)
    stream = currentStream();
  if (!cuda::graphDriver().supportsGraphs)
    throw captureError(index, "the CUDA driver has no graphs");
  bool active = stream->isCapturing();
  if (external && !active)
    throw captureError(index, "expects a stream that is being captured, but "
                              "nobody began to");
  if (!external && active)
    throw captureError(index, "the stream is being captured already");
  auto capture =
      std::make_unique<CudaCapture>(index, std::move(stream), mode, external);
  capture->start();
  return capture;
}

//===- CudaGraph.h - Graphs and captures of CUDA devices --------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_CUDA_CUDAGRAPH_H
#define WARP_LIB_RUNTIME_CUDA_CUDAGRAPH_H

#include "GraphClone.h"
#include "GraphImpl.h"
#include "GraphRefresh.h"
#include "GraphRewrite.h"
#include "warp/Forks.h"

#include <atomic>
#include <memory>
#include <string>
#include <vector>

namespace warp {

using cuda::GraphHandle;
using cuda::GraphNode;
using cuda::StreamHandle;

class CudaGraph : public Graph {
public:
  CudaGraph(int device, GraphHandle graph, cuda::GraphExec exec,
            std::shared_ptr<Kept> kept,
            std::vector<ProvisionalLaunch> provisional = {})
      : Graph(device), graph(graph), exec(exec), kept(std::move(kept)),
        provisional(std::move(provisional)) {
    isProvisional = this->provisional.size() != 0;
  }
  ~CudaGraph() override;

  void launch(const Stream *stream) override;
  size_t size() const override;
  size_t provisionalLaunches() const override { return provisional.size(); }
  bool isShort() const override { return false; }
  void writeDot(const std::string &path, bool verbose) const override;

  /// The same in the order of recording, to compare; null if nobody asks.
  cuda::GraphExec recorded = nullptr;

private:
  void checkOwned(const char *what) const;
  bool addToCapture(StreamHandle stream) const;
  void takeBetterCode();

  /// Null if somebody else ended the capture.
  GraphHandle graph;
  cuda::GraphExec exec;
  std::shared_ptr<Kept> kept;
  cuda::ProvisionalNodes provisional;
  std::atomic<bool> isProvisional{false};
  ForkMutex refreshing;
};

/// An outer graph whose capture waits for a body to be filled.
struct Paused {
  GraphHandle graph;
  GraphNode node;
  GraphHandle body;
  GraphStep step;
};

class CudaCapture final : public CaptureBase {
public:
  CudaCapture(int device, std::shared_ptr<Stream> stream, CaptureMode mode,
              bool external)
      : CaptureBase(device), stream(std::move(stream)),
        mode(static_cast<int>(mode)), external(external), rewriter(device) {}
  ~CudaCapture() override;

  void start();
  std::shared_ptr<Graph> end() override;
  Condition addCondition(const int32_t *value, bool negated) override;
  void updateCondition(Condition condition, const int32_t *value,
                       bool negated) override;
  void beginBody(Condition condition, bool loop) override;
  void endBody() override;
  bool records(const Stream *other) const override;
  std::vector<NodeId> position(const Stream *other) const override;
  /// Graphs of others, and those that are compared, keep their code.
  bool takesBetterCode() const override {
    return !external && order != NodeOrder::Verified &&
           cuda::canRefreshGraphs();
  }

private:
  StreamHandle raw() const {
    return static_cast<StreamHandle>(stream->handle());
  }
  GraphHandle stop();
  void noteGraph();
  cuda::GraphExec instantiate(GraphHandle graph,
                              std::shared_ptr<const GraphSchedule> &schedule);
  void setCondition(Condition condition, const int32_t *value, bool negated);

  std::shared_ptr<Stream> stream;
  int mode;
  bool external;
  bool running = false;
  /// The one that is captured into now; null if the driver does not say.
  GraphHandle current = nullptr;
  std::vector<Paused> paused;
  cuda::GraphRewriter rewriter;
};

/// The graph that a stream adds to, and the nodes the next one comes after.
struct Position {
  explicit Position(StreamHandle stream) {
    cuda::CaptureStatus status = cuda::captureNone;
    uint64_t id;
    WARP_CUDA_GRAPH(captureInfo, stream, &status, &id, &graph, &dependencies,
                    &count);
  }

  /// Lets the next node come after these alone.
  void set(StreamHandle stream, GraphNode node) {
    set(stream, std::vector<GraphNode>{node});
  }
  void set(StreamHandle stream, std::vector<GraphNode> nodes) {
    WARP_CUDA_GRAPH(updateDependencies, stream, nodes.data(), nodes.size(),
                    cuda::setDependencies);
  }

  GraphHandle graph = nullptr;
  const GraphNode *dependencies = nullptr;
  size_t count = 0;
};

namespace cuda {
/// The kernel that sets the handle of a branch or loop; loaded once per device,
/// never unloaded.
Function conditionKernel(int device);
} // namespace cuda

Error captureError(int device, const std::string &problem);

} // namespace warp

#endif // WARP_LIB_RUNTIME_CUDA_CUDAGRAPH_H

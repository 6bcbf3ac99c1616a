//===- Graph.cpp - CUDA graphs: capture, conditions, replay ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The driver records what is queued on the capturing stream. Memory that is
// allocated meanwhile is ordinary memory, made on a stream of its own (see
// Memory.cpp), so that arrays born in a capture can be used like any other
// before the first replay and between replays.
//
// A branch or loop is a conditional node. A kernel of one thread, here as PTX,
// reads the condition array and sets the node's handle; the driver provides
// the function that it calls. To fill the body the capture of the outer graph
// is ended, the same stream captures into the body's graph, and then the outer
// capture is resumed behind the new node: launches in the body need not know
// where they go.
//
//===----------------------------------------------------------------------===//

#include "Device.h"
#include "GraphClone.h"
#include "GraphImpl.h"
#include "GraphRefresh.h"
#include "GraphRewrite.h"
#include "GraphVerify.h"
#include "Runtime/LaunchQueue.h"
#include "warp/Forks.h"

#include <map>

using namespace warp;
using cuda::GraphHandle;
using cuda::GraphNode;
using cuda::StreamHandle;

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

namespace {

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

} // namespace

static cuda::Function conditionKernel(int device);

static std::string aliasOf(int device) { return deviceInfo(device).alias; }

static Error captureError(int device, const std::string &problem) {
  return Error(Error::Kind::Runtime,
               "graph capture on '" + aliasOf(device) + "': " + problem);
}

namespace {
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
} // namespace

//===----------------------------------------------------------------------===//
// Graphs
//===----------------------------------------------------------------------===//

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
    position.set(stream, cuda::cloneNodes(device(), graph, position.graph,
                                          after, conditionKernel(device())));
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

//===----------------------------------------------------------------------===//
// Captures
//===----------------------------------------------------------------------===//

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

//===----------------------------------------------------------------------===//
// Branches and loops
//===----------------------------------------------------------------------===//

/// The kernel that sets a handle; loaded once per device, never unloaded.
static cuda::Function conditionKernel(int device) {
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
  WARP_CUDA(launchKernel, conditionKernel(device()), 1, 1, 1, 1, 1, 1, 0, raw(),
            arguments, nullptr);
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

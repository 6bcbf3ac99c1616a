//===- FakeGraphs.cpp - Graphs of the fake driver -------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A graph has calls and edges between them. Streams that are captured into it
// append to it; a stream joins by waiting for an event that was recorded on one
// of them. A capture ends in an error if the stream that it began on does not
// come behind all nodes, on whatever way, or if something was done that the
// driver forbids meanwhile. Nodes run one after the other, in the order of
// their making or, so that a test finds an edge that is missing, in another one
// that the edges allow.
//
// A kernel behind a programmatic edge may run as soon as the one before it has
// begun, unless its code waits (griddepcontrol.wait): then it comes behind the
// end of that one, but not behind what that one has not waited for. A kernel
// that lets others start early (griddepcontrol.launch_dependents) does so for
// all that come behind it once one of them has a programmatic edge.
//
//===----------------------------------------------------------------------===//

#include "FakeGraphs.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <map>
#include <memory>
#include <mutex>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace {

constexpr int success = 0, invalidValue = 1;
constexpr int captureUnsupported = 900, captureInvalidated = 901;
constexpr int captureUnjoined = 904, updateFailure = 910;

constexpr int notSupported = 801;
constexpr int kernelNode = 0, copyNode = 1, conditionalNode = 13;

/// The arguments of a kernel that sets a condition.
struct Setting {
  uint64_t handle;
  const int *value;
  unsigned negated;
  void *arguments[3];
};

/// CUgraphEdgeData; a kernel that may start before its predecessor has ended.
using EdgeData = std::array<unsigned char, 8>;
constexpr EdgeData programmaticEdge = {1, 0, 1};

/// Other records count as a copy of memory.
struct Node {
  std::function<int()> call;
  int type = copyNode;
  Setting setting = {};
  /// The function of a kernel, which is its code, and its arguments.
  void *function = nullptr;
  void *arguments[1] = {};
  /// The nodes that it comes behind.
  std::map<Node *, EdgeData> before = {};

  void follow(Node *const *nodes, size_t count) {
    for (size_t i = 0; i < count; ++i)
      before[nodes[i]] = {};
  }
  bool has(const char *instruction) const {
    return function && static_cast<std::string *>(function)->find(
                           instruction) != std::string::npos;
  }
};

/// The function of the kernel that ran last.
void *fakeLastFunction = nullptr;

/// The order of nodes that edges leave open: that of their making for 0.
unsigned orderSeed = 0;

struct Graph;
/// The graphs that there are, bodies too.
std::set<Graph *> &everyGraph() {
  static auto *all = new std::set<Graph *>;
  return *all;
}

struct Graph {
  Graph() { everyGraph().insert(this); }
  ~Graph() { everyGraph().erase(this); }
  Graph(const Graph &) = delete;
  Graph &operator=(const Graph &) = delete;

  std::vector<std::unique_ptr<Node>> nodes;
  /// The nodes of the bodies inside.
  std::vector<std::unique_ptr<Graph>> bodies;
  bool hasExecutable = false;

  Node *add(std::function<int()> call, int type = copyNode) {
    nodes.push_back(std::make_unique<Node>(Node{std::move(call), type}));
    return nodes.back().get();
  }
  Node *addSetting(uint64_t handle, const int *value, unsigned negated) {
    Node *node = add([=] { return fakeSetCondition(handle, value, negated); },
                     kernelNode);
    node->setting = {handle, value, negated, {}};
    return node;
  }
  /// True if a node may begin once others have ended.
  static bool mayBegin(const Node &node, const std::set<Node *> &done,
                       const std::set<Node *> &hasEarly) {
    return std::all_of(node.before.begin(), node.before.end(),
                       [&](const auto &edge) {
                         auto &[before, data] = edge;
                         bool isEarly = data == programmaticEdge
                                            ? !node.has("griddepcontrol.wait")
                                            : hasEarly.count(before) != 0;
                         return done.count(before) != 0 ||
                                (isEarly && mayBegin(*before, done, hasEarly));
                       });
  }
  int run() const {
    std::minstd_rand random(orderSeed);
    std::set<Node *> done, hasEarly;
    std::vector<Node *> left;
    for (const auto &node : nodes) {
      left.push_back(node.get());
      for (const auto &[before, data] : node->before)
        if (data == programmaticEdge &&
            before->has("griddepcontrol.launch_dependents"))
          hasEarly.insert(before);
    }
    while (!left.empty()) {
      std::vector<size_t> ready;
      for (size_t i = 0; i < left.size(); ++i)
        if (mayBegin(*left[i], done, hasEarly))
          ready.push_back(i);
      if (ready.empty())
        return invalidValue;
      size_t next = ready[orderSeed ? random() % ready.size() : 0];
      if (int result = left[next]->call())
        return result;
      if (left[next]->function)
        fakeLastFunction = left[next]->function;
      done.insert(left[next]);
      left.erase(left.begin() + std::ptrdiff_t(next));
    }
    return success;
  }
};

struct Capture {
  void *origin;
  Graph *graph;
  bool invalid = false;
  /// Nodes that each stream comes behind.
  std::map<void *, std::set<Node *>> reached;
  std::vector<Node *> made;
  std::vector<Node *> shown;

  void follow(void *stream, Node *node, bool isProgrammatic = false) {
    for (Node *before : std::exchange(reached[stream], {node}))
      node->before[before] = isProgrammatic && before->type == kernelNode
                                 ? programmaticEdge
                                 : EdgeData{};
    made.push_back(node);
  }
  /// True if the stream that it began on comes behind all nodes.
  bool isJoined() {
    std::vector<Node *> left(reached[origin].begin(), reached[origin].end());
    std::set<Node *> seen(left.begin(), left.end());
    while (!left.empty()) {
      Node *node = left.back();
      left.pop_back();
      for (const auto &edge : node->before)
        if (seen.insert(edge.first).second)
          left.push_back(edge.first);
    }
    return std::all_of(made.begin(), made.end(),
                       [&](Node *node) { return seen.count(node) != 0; });
  }
};

std::recursive_mutex mutex;
std::map<void *, std::shared_ptr<Capture>> captures;
struct Recorded {
  std::shared_ptr<Capture> capture;
  std::set<Node *> reached;
};
std::map<void *, Recorded> events;
std::vector<int> conditions;
thread_local int mode = 0;
using Lock = std::lock_guard<std::recursive_mutex>;

std::shared_ptr<Capture> captureOf(void *stream) {
  auto found = captures.find(stream);
  return found == captures.end() ? nullptr : found->second;
}

} // namespace

bool fakeRecord(void *stream, std::function<int()> call, void *function,
                bool isProgrammatic) {
  Lock lock(mutex);
  std::shared_ptr<Capture> capture = captureOf(stream);
  if (!capture)
    return false;
  Node *node =
      capture->graph->add(std::move(call), function ? kernelNode : copyNode);
  node->function = function;
  capture->follow(stream, node, isProgrammatic);
  return true;
}

bool fakeRecordCondition(void *stream, uint64_t handle, const int *value,
                         unsigned negated) {
  Lock lock(mutex);
  std::shared_ptr<Capture> capture = captureOf(stream);
  if (capture)
    capture->follow(stream, capture->graph->addSetting(handle, value, negated));
  return capture != nullptr;
}

bool fakeIsCapturing(void *stream) {
  Lock lock(mutex);
  return captureOf(stream) != nullptr;
}

void fakeInvalidateCaptures() {
  Lock lock(mutex);
  for (auto &[stream, capture] : captures)
    capture->invalid = true;
}

void fakeRecordEvent(void *event, void *stream) {
  Lock lock(mutex);
  std::shared_ptr<Capture> capture = captureOf(stream);
  events[event] = {capture, {}};
  if (capture)
    events[event].reached = capture->reached[stream];
}

void fakeWaitEvent(void *stream, void *event) {
  Lock lock(mutex);
  Recorded recorded = events[event];
  if (!recorded.capture)
    return;
  captures[stream] = recorded.capture;
  recorded.capture->reached[stream].insert(recorded.reached.begin(),
                                           recorded.reached.end());
}

void *fakeSetter = nullptr;

int fakeSetCondition(uint64_t handle, const int *value, bool negated) {
  conditions[handle] = (*value != 0) != negated;
  return success;
}

#define EXPORT extern "C" __attribute__((visibility("default")))

EXPORT int cuStreamIsCapturing(void *stream, int *status) {
  *status = fakeIsCapturing(stream);
  return success;
}
EXPORT int cuThreadExchangeStreamCaptureMode(int *wanted) {
  std::swap(mode, *wanted);
  return success;
}
static int begin(void *stream, Graph *graph, Node *const *after = nullptr,
                 size_t count = 0) {
  Lock lock(mutex);
  if (!stream)
    return captureUnsupported;
  if (captureOf(stream))
    return invalidValue;
  auto capture = std::make_shared<Capture>();
  capture->origin = stream;
  capture->graph = graph;
  capture->reached[stream] = {after, after + count};
  captures[stream] = capture;
  return success;
}
EXPORT int cuStreamBeginCapture_v2(void *stream, int) {
  return begin(stream, new Graph);
}
EXPORT int cuStreamBeginCaptureToGraph(void *stream, Graph *graph,
                                       Node *const *after, const void *,
                                       size_t count, int) {
  return begin(stream, graph, after, count);
}
EXPORT int cuStreamEndCapture(void *stream, Graph **graph) {
  Lock lock(mutex);
  *graph = nullptr;
  std::shared_ptr<Capture> capture = captureOf(stream);
  if (!capture || capture->origin != stream)
    return invalidValue;
  std::erase_if(captures,
                [&](const auto &entry) { return entry.second == capture; });
  if (capture->invalid)
    return captureInvalidated;
  if (!capture->isJoined())
    return captureUnjoined;
  *graph = capture->graph;
  return success;
}
EXPORT int cuStreamGetCaptureInfo_v2(void *stream, int *status, uint64_t *,
                                     Graph **graph, Node *const **nodes,
                                     size_t *count) {
  Lock lock(mutex);
  std::shared_ptr<Capture> capture = captureOf(stream);
  *status = capture != nullptr;
  *graph = capture ? capture->graph : nullptr;
  *nodes = nullptr;
  *count = 0;
  if (!capture)
    return success;
  const std::set<Node *> &reached = capture->reached[stream];
  capture->shown.assign(reached.begin(), reached.end());
  *nodes = capture->shown.data();
  *count = capture->shown.size();
  return success;
}
EXPORT int cuStreamUpdateCaptureDependencies(void *stream, Node **nodes,
                                             size_t count, unsigned) {
  Lock lock(mutex);
  if (std::shared_ptr<Capture> capture = captureOf(stream))
    capture->reached[stream] = {nodes, nodes + count};
  return success;
}
EXPORT int cuGraphAddChildGraphNode(Node **node, Graph *graph,
                                    Node *const *after, size_t count,
                                    Graph *child) {
  // The driver makes a copy.
  auto copy = std::make_shared<Graph>();
  std::map<Node *, Node *> copies;
  for (const auto &one : child->nodes) {
    if (one->type == conditionalNode)
      return notSupported;
    copies[one.get()] = copy->add(one->call, one->type);
  }
  for (const auto &one : child->nodes)
    for (const auto &[before, data] : one->before)
      copies[one.get()]->before[copies[before]] = data;
  *node = graph->add([copy] { return copy->run(); });
  (*node)->follow(after, count);
  return success;
}
/// Edges of the graph that was instantiated last that let a kernel start early.
static int programmaticEdges = 0;
/// Graphs that are refused next.
static int refusals = 0;
EXPORT void fakeCudaRefuseGraphs(int count) { refusals = count; }
EXPORT int cuGraphInstantiateWithFlags(void **exec, Graph *graph,
                                       unsigned long long) {
  // One executable alone of a graph with branches or loops.
  if (graph->hasExecutable && !graph->bodies.empty())
    return notSupported;
  if (refusals > 0) {
    --refusals;
    return invalidValue;
  }
  graph->hasExecutable = true;
  *exec = graph;
  programmaticEdges = 0;
  for (const auto &node : graph->nodes)
    for (const auto &edge : node->before)
      programmaticEdges += edge.second == programmaticEdge;
  return success;
}
EXPORT int cuGraphLaunch(void *exec, void *stream) {
  if (captureOf(stream))
    return invalidValue;
  return static_cast<Graph *>(exec)->run();
}
EXPORT int cuGraphExecDestroy(void *) { return success; }
EXPORT int cuGraphDestroy(Graph *graph) {
  delete graph;
  return success;
}
EXPORT int cuGraphDestroyNode(Node *node) {
  Lock lock(mutex);
  for (Graph *graph : everyGraph())
    for (size_t i = 0; i < graph->nodes.size(); ++i)
      if (graph->nodes[i].get() == node) {
        for (const auto &other : graph->nodes)
          other->before.erase(node);
        graph->nodes.erase(graph->nodes.begin() + std::ptrdiff_t(i));
        return success;
      }
  return invalidValue;
}
EXPORT int cuGraphGetNodes(Graph *graph, Node **nodes, size_t *count) {
  *count = graph->nodes.size();
  for (size_t i = 0; nodes && i < *count; ++i)
    nodes[i] = graph->nodes[i].get();
  return success;
}
EXPORT int cuGraphNodeGetType(Node *node, int *type) {
  *type = node->type;
  return success;
}
EXPORT int cuGraphNodeGetDependencies(Node *node, Node **nodes, size_t *count) {
  *count = node->before.size();
  for (const auto &edge : node->before)
    if (nodes)
      *nodes++ = edge.first;
  return success;
}
EXPORT int cuGraphGetEdges_v2(Graph *graph, Node **from, Node **to,
                              EdgeData *data, size_t *count) {
  *count = 0;
  for (const auto &node : graph->nodes)
    for (const auto &[before, how] : node->before) {
      if (from) {
        from[*count] = before;
        to[*count] = node.get();
        data[*count] = how;
      }
      ++*count;
    }
  return success;
}
EXPORT int cuGraphAddDependencies_v2(Graph *, Node *const *from,
                                     Node *const *to, const EdgeData *data,
                                     size_t count) {
  for (size_t i = 0; i < count; ++i) {
    // Only between kernels, and no edge twice. As in driver 580, the attributes
    // of the first edge are those of all.
    if ((data[0] == programmaticEdge &&
         (from[i]->type != kernelNode || to[i]->type != kernelNode)) ||
        !to[i]->before.emplace(from[i], data[0]).second)
      return invalidValue;
  }
  return success;
}
EXPORT int cuGraphRemoveDependencies_v2(Graph *, Node *const *from,
                                        Node *const *to, const EdgeData *data,
                                        size_t count) {
  for (size_t i = 0; i < count; ++i) {
    // The attributes of an edge, and none but those of the first one.
    auto edge = to[i]->before.find(from[i]);
    if (edge == to[i]->before.end() || edge->second != data[i] ||
        data[i] != data[0])
      return invalidValue;
    to[i]->before.erase(edge);
  }
  return success;
}
EXPORT int fakeCudaProgrammaticEdges() { return programmaticEdges; }
EXPORT void fakeCudaSetGraphOrder(unsigned seed) { orderSeed = seed; }
EXPORT int cuGraphDebugDotPrint(Graph *graph, const char *path, unsigned) {
  FILE *file = std::fopen(path, "w");
  if (!file)
    return invalidValue;
  std::fprintf(file, "digraph { %zu }\n", graph->nodes.size());
  std::fclose(file);
  return success;
}
EXPORT int cuGraphConditionalHandleCreate(uint64_t *handle, Graph *graph,
                                          void *context, unsigned, unsigned) {
  if (!graph || !context)
    return invalidValue;
  *handle = conditions.size();
  conditions.push_back(0);
  return success;
}

namespace {
struct NodeParams {
  int type;
  int reserved[3];
  uint64_t handle;
  int kind;
  unsigned size;
  Graph **bodies;
  void *context;
};
} // namespace

EXPORT int cuGraphAddNode(Node **node, Graph *graph, Node *const *after,
                          size_t count, NodeParams *params) {
  if (params->type != 13 || params->size != 1 || !params->context)
    return invalidValue;
  graph->bodies.push_back(std::make_unique<Graph>());
  // The driver owns the array of bodies.
  static std::vector<std::unique_ptr<Graph *>> arrays;
  Graph *body = graph->bodies.back().get();
  arrays.push_back(std::make_unique<Graph *>(body));
  params->bodies = arrays.back().get();
  *node = graph->add(
      [body, handle = params->handle, loop = params->kind] {
        while (conditions[handle]) {
          if (int result = body->run())
            return result;
          if (!loop)
            break;
        }
        return success;
      },
      conditionalNode);
  (*node)->follow(after, count);
  return success;
}

//===----------------------------------------------------------------------===//
// Copies of nodes
//===----------------------------------------------------------------------===//

namespace {
struct KernelParams {
  void *function;
  unsigned extents[7];
  void **arguments, **extra;
  void *kernel, *context;
};
/// The driver's struct is larger; only passed on.
struct CopyParams {
  Node *node;
};
} // namespace

EXPORT int cuGraphKernelNodeGetParams_v2(Node *node, KernelParams *params) {
  Setting &setting = node->setting;
  if (!setting.value) {
    // Copies are made of the node.
    node->arguments[0] = node;
    *params = {node->function,  {},
               node->arguments, reinterpret_cast<void **>(node),
               nullptr,         nullptr};
    return success;
  }
  *params = {fakeSetter, {1, 1, 1, 1, 1, 1, 0}, nullptr, nullptr, nullptr,
             nullptr};
  void *arguments[] = {&setting.handle, &setting.value, &setting.negated};
  std::copy(arguments, arguments + 3, setting.arguments);
  params->arguments = setting.arguments;
  return success;
}
EXPORT int cuGraphAddKernelNode_v2(Node **node, Graph *graph,
                                   Node *const *after, size_t count,
                                   const KernelParams *params) {
  void **arguments = params->arguments;
  if (params->extra) {
    auto *source = reinterpret_cast<Node *>(params->extra);
    *node = graph->add(source->call, kernelNode);
    (*node)->function = params->function;
    (*node)->follow(after, count);
    return success;
  }
  *node = graph->addSetting(*static_cast<uint64_t *>(arguments[0]),
                            *static_cast<const int **>(arguments[1]),
                            *static_cast<unsigned *>(arguments[2]));
  (*node)->follow(after, count);
  return success;
}
EXPORT int cuGraphKernelNodeSetParams_v2(Node *node,
                                         const KernelParams *params) {
  if (!params->arguments || !params->arguments[0])
    return invalidValue;
  node->function = params->function;
  return success;
}
EXPORT int cuFuncGetParamInfo(void *, size_t index, size_t *offset,
                              size_t *size) {
  if (index != 0)
    return invalidValue;
  *offset = 0;
  *size = 8;
  return success;
}
static bool updatesGraphs = true;
EXPORT void fakeCudaSetUpdatesGraphs(bool does) { updatesGraphs = does; }
EXPORT int cuGraphExecUpdate_v2(void *exec, Graph *graph, void *) {
  return updatesGraphs && exec == graph ? success : updateFailure;
}
EXPORT void *fakeCudaLastFunction() { return fakeLastFunction; }
EXPORT int cuGraphKernelNodeCopyAttributes(Node *, Node *) { return success; }
EXPORT int cuGraphMemcpyNodeGetParams(Node *node, CopyParams *params) {
  params->node = node;
  return success;
}
EXPORT int cuGraphAddMemcpyNode(Node **node, Graph *graph, Node *const *after,
                                size_t count, const CopyParams *params,
                                void *context) {
  if (!context)
    return invalidValue;
  *node = graph->add(params->node->call);
  (*node)->follow(after, count);
  return success;
}
EXPORT int cuGraphMemsetNodeGetParams(Node *, void *) { return invalidValue; }
EXPORT int cuGraphAddMemsetNode(Node **, Graph *, Node *const *, size_t,
                                const void *, void *) {
  return invalidValue;
}
EXPORT int cuGraphChildGraphNodeGetGraph(Node *, Graph **) {
  return invalidValue;
}
EXPORT int cuGraphAddEmptyNode(Node **, Graph *, Node *const *, size_t) {
  return invalidValue;
}

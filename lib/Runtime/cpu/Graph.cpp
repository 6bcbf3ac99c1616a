//===- Graph.cpp - CPU graphs: lists of steps -----------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A CPU graph is a list of steps. A short launch is the code of the
// compiled kernel with a parameter block of its own: replaying it is one call.
// Everything else, launches that are spread over threads or need a look at
// their result, copies and fills, is a closure. Branches and loops hold a list
// of their own and run it as long as their flag is set; the flags are steps,
// too, and belong to one replay, so that a graph may run on two threads at
// once.
//
// A graph that is ordered by dependencies runs launches that were fused
// (GraphFusion.cpp) in place of those that were recorded, and may run its nodes
// on several threads (GraphBranches.cpp), if that turns out to be faster.
//
//===----------------------------------------------------------------------===//

#include "BranchTrial.h"
#include "Device.h"
#include "GraphBranches.h"
#include "GraphFusion.h"
#include "GraphImpl.h"
#include "GraphOrder.h"
#include "GraphVerify.h"
#include "Kernel.h"
#include "Pool.h"

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <cstring>
#include <map>
#include <set>
#include <variant>

using namespace warp;

/// Bytes and operations below which a replay is over before another thread
/// would run.
static constexpr size_t shortBytes = 64 << 10;
static constexpr double shortWork = 32768;
/// Bytes of a copy or fill that is worth several threads.
static constexpr size_t wideBytes = 256 << 10;

namespace {

struct Step;
using Steps = std::vector<Step>;

struct EntryStep {
  const Kernel::Variant *variant;
  const void *params;
  int64_t items;
};

struct FlagStep {
  size_t flag;
  const int32_t *value;
  bool negated;
};

struct BodyStep {
  size_t flag;
  bool loop;
  std::unique_ptr<Steps> steps;
};

struct Step {
  std::variant<EntryStep, std::function<void()>, FlagStep, BodyStep> what;
  /// For pictures.
  std::string name;
  /// It has work for several threads, or is for the one that replays.
  bool isWide = false;
};

/// The order of a list of steps.
struct StepOrder {
  /// The steps of each node of the schedule.
  std::vector<std::vector<const Step *>> nodes;
  std::shared_ptr<GraphSchedule> schedule;
  /// The orders of the bodies among the nodes.
  std::map<size_t, StepOrder> bodies;
  /// Steps in place of several of the list, and what they run.
  std::vector<std::unique_ptr<Step>> fused;
  std::vector<FusedLaunch> launches;
  /// Runs of nodes that are worth several threads.
  std::vector<GraphBranches> branches;

  /// True if the list runs other steps than were recorded.
  bool hasFused() const {
    return !fused.empty() ||
           std::any_of(bodies.begin(), bodies.end(),
                       [](const auto &body) { return body.second.hasFused(); });
  }
};

class HostGraph : public Graph {
public:
  HostGraph() : Graph(hostDevice().index) {}

  void launch(const Stream *stream) override;
  size_t size() const override { return steps.size(); }
  bool isShort() const override {
    return flags == 0 && work < shortWork && bytes < shortBytes;
  }
  void writeDot(const std::string &path, bool verbose) const override;
  std::shared_ptr<const GraphSchedule> schedule() const override;
  void verify(char *values) const;
  void runBranches(char *values) const;
  void runInOrder(char *values) const;
  void setOrder(NodeOrder wanted);

  NodeOrder order = NodeOrder::Recorded;
  StepOrder stepOrder;
  bool isFused = false;
  BranchTrial trial;
  Steps steps;
  /// Parameter blocks of the entry steps.
  std::vector<std::unique_ptr<uint64_t[]>> blocks;
  size_t flags = 0;
  double work = 0;
  size_t bytes = 0;
  std::shared_ptr<Kept> kept;
};

class HostCapture final : public CaptureBase, public HostRecorder {
public:
  HostCapture() : CaptureBase(hostDevice().index), graph(new HostGraph) {
    setThreadRecorder(this);
  }
  ~HostCapture() override {
    if (graph)
      stop();
  }

  void launch(Kernel &kernel, const Kernel::Plan &plan,
              const void *params) override;
  void call(std::function<void()> function, size_t bytes) override {
    if (trace() && !TraceScope::active())
      trace()->addOther("work of a library on the host");
    graph->bytes += bytes;
    add({std::move(function), "copy or fill", bytes >= wideBytes});
  }

  std::shared_ptr<Graph> end() override;
  Condition addCondition(const int32_t *value, bool negated) override {
    GraphStep step = beginStep(nullptr);
    if (trace())
      trace()->addCondition(graph->flags, value, negated);
    setFlag(graph->flags, value, negated);
    endStep(std::move(step), nullptr);
    return graph->flags++;
  }
  void updateCondition(Condition condition, const int32_t *value,
                       bool negated) override {
    GraphStep step = beginStep(nullptr);
    if (trace())
      trace()->updateCondition(condition, value, negated);
    setFlag(static_cast<size_t>(condition), value, negated);
    endStep(std::move(step), nullptr);
  }
  void beginBody(Condition condition, bool loop) override;
  void endBody() override;
  void addHost(std::function<void()> function,
               const std::string &name) override;
  std::vector<NodeId> position(const Stream *) const override {
    // The list of a body that has just begun is empty.
    return {reinterpret_cast<NodeId>(open.back()->size() + 1)};
  }

private:
  void add(Step step) { open.back()->push_back(std::move(step)); }
  void setFlag(size_t flag, const int32_t *value, bool negated) {
    add({FlagStep{flag, value, negated}, "condition"});
  }
  void stop() {
    if (threadRecorder() == this)
      setThreadRecorder(nullptr);
    graph->kept = close();
  }

  std::shared_ptr<HostGraph> graph;
  /// The lists being written, from the graph's own inwards.
  std::vector<Steps *> open{&graph->steps};
  /// The calls that the bodies which are open belong to.
  std::vector<GraphStep> outer;
};

} // namespace

//===----------------------------------------------------------------------===//
// Recording
//===----------------------------------------------------------------------===//

std::unique_ptr<CaptureBase> CpuDevice::beginCapture(std::shared_ptr<Stream>,
                                                     CaptureMode, bool) {
  if (threadRecorder())
    throw Error(Error::Kind::Runtime,
                "this thread is capturing a graph on 'cpu' already");
  return std::make_unique<HostCapture>();
}

/// A launch whose parameters stay where they are.
static Step stepOf(Kernel &kernel, const Kernel::Plan &plan, uint64_t *data) {
  const Kernel::Variant &variant = *plan.variant;
  bool reports = Kernel::reports(plan);
  if (isCheap(plan) && !reports && !variant.code.schedule.exclusive &&
      !variant.code.schedule.atomics && variant.code.schedule.sums.empty() &&
      !variant.code.schedule.usesPrintf)
    return {EntryStep{&variant, data, plan.items}, kernel.name()};
  std::function<void()> run = [&kernel, plan, data] { kernel.run(plan, data); };
  if (reports) {
    // The address of the error record is written into the block.
    size_t size = kernel.parameterSize();
    run = [&kernel, plan, data, size] {
      std::vector<uint64_t> own(data, data + size / 8);
      kernel.run(plan, own.data());
    };
  }
  return {std::move(run), kernel.name(), !isCheap(plan)};
}

void HostCapture::launch(Kernel &kernel, const Kernel::Plan &plan,
                         const void *params) {
  auto block = std::make_unique<uint64_t[]>(kernel.parameterSize() / 8);
  std::memcpy(block.get(), params, kernel.parameterSize());
  graph->work += plan.work;
  add(stepOf(kernel, plan, block.get()));
  graph->blocks.push_back(std::move(block));
}

void HostCapture::beginBody(Condition condition, bool loop) {
  outer.push_back(beginStep(nullptr));
  if (trace())
    trace()->beginBody(condition, loop);
  add({BodyStep{static_cast<size_t>(condition), loop,
                std::make_unique<Steps>()},
       loop ? "while" : "if"});
  open.push_back(std::get<BodyStep>(open.back()->back().what).steps.get());
}

void HostCapture::endBody() {
  if (open.size() == 1)
    throw Error(Error::Kind::Runtime, "no body of a graph is open");
  open.pop_back();
  if (trace())
    trace()->endBody();
  endStep(std::move(outer.back()), nullptr);
  outer.pop_back();
}

void HostCapture::addHost(std::function<void()> function,
                          const std::string &name) {
  if (trace())
    trace()->addOther("a call of the host, '" + name + "'");
  // It may wait for other processes.
  graph->work += shortWork;
  add({std::move(function), name, true});
}

std::shared_ptr<Graph> HostCapture::end() {
  if (threadRecorder() != this)
    throw Error(Error::Kind::Runtime,
                "expects the thread that began the capture to end it");
  bool complete = open.size() == 1;
  stop();
  handTrace(*graph);
  graph->setOrder(order);
  std::shared_ptr<Graph> result = std::move(graph);
  if (!complete)
    throw Error(Error::Kind::Runtime,
                "the capture ends inside of a branch or loop");
  return result;
}

//===----------------------------------------------------------------------===//
// Replay
//===----------------------------------------------------------------------===//

/// `runBody` runs the steps of a branch or loop once.
template <typename Fn>
static void runStep(const Step &step, char *flags, Fn &&runBody) {
  if (auto *entry = std::get_if<EntryStep>(&step.what)) {
    runOnCpu(*entry->variant, entry->params, 0, entry->items);
  } else if (auto *call = std::get_if<std::function<void()>>(&step.what)) {
    (*call)();
  } else if (auto *flag = std::get_if<FlagStep>(&step.what)) {
    flags[flag->flag] = (*flag->value != 0) != flag->negated;
  } else {
    const auto &body = std::get<BodyStep>(step.what);
    while (flags[body.flag]) {
      runBody(*body.steps);
      if (!body.loop)
        break;
    }
  }
}

static void run(const Steps &steps, char *flags) {
  for (const Step &step : steps)
    runStep(step, flags, [&](const Steps &body) { run(body, flags); });
}

void HostGraph::launch(const Stream *) {
  TraceScope tracing(device(), nullptr);
  if (tracing)
    tracing->addGraph(*this);
  auto self = std::static_pointer_cast<HostGraph>(shared_from_this());
  if (recordOnHost(bytes, [self] { self->launch(nullptr); }))
    return;
  std::vector<char> values(flags);
  if (order == NodeOrder::Verified)
    return verify(values.data());
  if (stepOrder.branches.empty())
    return runInOrder(values.data());
  int64_t number = trial.begin();
  bool isTrial = BranchTrial::isTrial(number);
  int64_t start = isTrial ? wallTime() : 0;
  if (trial.uses(number))
    runBranches(values.data());
  else
    runInOrder(values.data());
  if (isTrial)
    trial.record(number, wallTime() - start);
}

//===----------------------------------------------------------------------===//
// Order
//===----------------------------------------------------------------------===//

static size_t placeOf(const std::vector<NodeId> &position) {
  return reinterpret_cast<uintptr_t>(position.front()) - 1;
}

/// The nodes of a list: its steps by the calls that they belong to.
static std::vector<NodeRecord> nodesOf(const Steps &list,
                                       const GraphTrace &trace,
                                       const std::vector<GraphStep> &calls,
                                       StepOrder &order) {
  std::vector<NodeRecord> records;
  size_t next = 0;
  auto add = [&](size_t end, NodeRecord record) {
    std::vector<const Step *> &node = order.nodes.emplace_back();
    for (; next < end; ++next)
      node.push_back(&list[next]);
    records.push_back(std::move(record));
  };
  for (const GraphStep &call : calls) {
    size_t begin = placeOf(call.before), end = placeOf(call.after);
    while (next < begin)
      add(next + 1, unknownNode(list[next].name));
    add(end, recordOf(trace, call.first, call.last));
  }
  while (next < list.size())
    add(next + 1, unknownNode(list[next].name));
  return records;
}

/// Puts fused launches in the place of those that were recorded.
static void exchangeNodes(StepOrder &order, FusedNodes &fused) {
  std::vector<std::vector<const Step *>> nodes;
  for (size_t i = 0; i < fused.members.size(); ++i) {
    auto launch = fused.launches.find(i);
    if (launch == fused.launches.end()) {
      nodes.push_back(std::move(order.nodes[fused.members[i].front()]));
      continue;
    }
    order.launches.push_back(std::move(launch->second));
    FusedLaunch &made = order.launches.back();
    order.fused.push_back(std::make_unique<Step>(
        stepOf(*made.kernel, made.plan, made.params.data())));
    nodes.push_back({order.fused.back().get()});
  }
  order.nodes = std::move(nodes);
}

/// The order of a list.
static StepOrder orderOf(const Steps &list, const GraphTrace &trace,
                         const std::vector<GraphStep> &calls) {
  StepOrder order;
  std::vector<NodeRecord> records = nodesOf(list, trace, calls, order);
  order.schedule = makeSchedule(records, chainOf(records.size()), {});
  FusedNodes fused = fuseLaunches(records, *order.schedule);
  size_t recordedEdges = order.schedule->recordedEdges;
  exchangeNodes(order, fused);
  order.schedule =
      makeSchedule(fused.records, chainOf(fused.records.size()), {});
  order.schedule->recordedEdges = recordedEdges;
  for (size_t i = 0; i < order.nodes.size(); ++i)
    for (const Step *step : order.nodes[i]) {
      auto *body = std::get_if<BodyStep>(&step->what);
      if (!body || order.nodes[i].size() != 1)
        continue;
      // The call that has the step.
      for (const GraphStep &call : calls)
        if (placeOf(call.before) == size_t(step - list.data()))
          if (auto found = trace.bodies.find(call.first);
              found != trace.bodies.end()) {
            StepOrder &inner = order.bodies[i] =
                orderOf(*body->steps, trace, found->second);
            order.schedule->nodes[i].body = inner.schedule;
          }
    }
  return order;
}

/// True if a step is for the thread that replays, or all of them.
static bool isWide(const Step &step) {
  if (auto *body = std::get_if<BodyStep>(&step.what))
    return std::any_of(body->steps->begin(), body->steps->end(), isWide);
  return step.isWide;
}

/// Collects runs of nodes between those that keep their thread.
static void findBranches(StepOrder &order) {
  const auto &nodes = order.schedule->nodes;
  auto isApart = [&](size_t node) {
    const std::vector<const Step *> &steps = order.nodes[node];
    return !nodes[node].barrier.empty() ||
           std::any_of(steps.begin(), steps.end(),
                       [](const Step *step) { return isWide(*step); });
  };
  for (size_t first = 0; first < nodes.size(); ++first) {
    size_t last = first;
    while (last < nodes.size() && !isApart(last))
      ++last;
    if (last > first + 1) {
      GraphBranches branches(*order.schedule, first, last);
      if (branches.width() > 1)
        order.branches.push_back(std::move(branches));
    }
    first = last;
  }
}

std::shared_ptr<const GraphSchedule> HostGraph::schedule() const {
  return stepOrder.schedule;
}

void HostGraph::setOrder(NodeOrder wanted) {
  order = wanted;
  if (order == NodeOrder::Recorded)
    return;
  stepOrder = orderOf(steps, *operations(), operations()->steps.front());
  isFused = stepOrder.hasFused();
  if (!isShort())
    findBranches(stepOrder);
}

static void runNodes(const StepOrder &order, size_t first, size_t last,
                     char *flags) {
  for (size_t node = first; node < last; ++node) {
    auto inner = order.bodies.find(node);
    for (const Step *step : order.nodes[node])
      runStep(*step, flags, [&](const Steps &body) {
        if (inner == order.bodies.end())
          run(body, flags);
        else
          runNodes(inner->second, 0, inner->second.nodes.size(), flags);
      });
  }
}

/// Runs the nodes one after the other.
void HostGraph::runInOrder(char *values) const {
  if (isFused)
    runNodes(stepOrder, 0, stepOrder.nodes.size(), values);
  else
    run(steps, values);
}

/// Runs the nodes in their order, but for those on branches.
void HostGraph::runBranches(char *values) const {
  size_t next = 0;
  for (const GraphBranches &branches : stepOrder.branches) {
    runNodes(stepOrder, next, branches.first(), values);
    branches.run(
        [&](size_t node) { runNodes(stepOrder, node, node + 1, values); });
    next = branches.last();
  }
  runNodes(stepOrder, next, stepOrder.nodes.size(), values);
}

/// Runs a list such that each node comes as late as its edges allow.
static void runLate(const StepOrder &order, char *flags) {
  const auto &nodes = order.schedule->nodes;
  // From the end: of the nodes that nothing left comes behind, the first one
  // is the last to run.
  std::vector<size_t> followers(nodes.size()), late;
  for (const GraphSchedule::Node &node : nodes)
    for (const GraphSchedule::Edge &edge : node.before)
      ++followers[edge.from];
  std::set<size_t> free;
  for (size_t i = 0; i < nodes.size(); ++i)
    if (followers[i] == 0)
      free.insert(i);
  while (!free.empty()) {
    size_t node = *free.begin();
    free.erase(free.begin());
    late.push_back(node);
    for (const GraphSchedule::Edge &edge : nodes[node].before)
      if (--followers[edge.from] == 0)
        free.insert(edge.from);
  }
  for (; !late.empty(); late.pop_back()) {
    auto body = order.bodies.find(late.back());
    for (const Step *step : order.nodes[late.back()])
      runStep(*step, flags, [&](const Steps &steps) {
        if (body == order.bodies.end())
          run(steps, flags);
        else
          runLate(body->second, flags);
      });
  }
}

void HostGraph::verify(char *values) const {
  runBothOrders(
      device(), *operations(), [&] { run(steps, values); },
      [&] { runLate(stepOrder, values); });
}

//===----------------------------------------------------------------------===//
// Pictures
//===----------------------------------------------------------------------===//

/// Writes the nodes of a list as a chain; returns the number of the last one.
static int writeSteps(FILE *file, const Steps &steps, int &count, int before,
                      bool verbose) {
  for (const Step &step : steps) {
    int number = count++;
    auto *entry = std::get_if<EntryStep>(&step.what);
    std::string items = verbose && entry
                            ? "\\n" + std::to_string(entry->items) + " threads"
                            : "";
    std::fprintf(file, "  n%d [label=\"%s%s\"];\n", number, step.name.c_str(),
                 items.c_str());
    if (before >= 0)
      std::fprintf(file, "  n%d -> n%d;\n", before, number);
    before = number;
    if (auto *body = std::get_if<BodyStep>(&step.what)) {
      int last = writeSteps(file, *body->steps, count, number, verbose);
      if (last != number)
        std::fprintf(file, "  n%d -> n%d [style=dashed];\n", last, number);
    }
  }
  return before;
}

void HostGraph::writeDot(const std::string &path, bool verbose) const {
  FILE *file = std::fopen(path.c_str(), "w");
  if (!file)
    throw Error(Error::Kind::Runtime, "cannot write '" + path + "'");
  std::fprintf(file, "digraph graph_cpu {\n  node [shape=box];\n");
  int count = 0;
  writeSteps(file, steps, count, -1, verbose);
  std::fprintf(file, "}\n");
  std::fclose(file);
}

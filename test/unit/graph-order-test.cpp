//===- graph-order-test.cpp - Dependency DAGs of captured graphs ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The edges are compared with those that sets of single bytes ask for. Captures
// run against the fake driver, in several orders that the edges allow, and are
// compared with the same calls without a capture.
//
//===----------------------------------------------------------------------===//

#include "Runtime/GraphOrder.h"
#include "Runtime/GraphVerify.h"
#include "Runtime/cpu/BranchTrial.h"
#include "Runtime/cpu/GraphBranches.h"
#include "warp/Fusion.h"
#include "warp/Runtime.h"

#include <algorithm>
#include <atomic>

#include <cstdlib>
#include <dlfcn.h>
#include <functional>
#include <gtest/gtest.h>
#include <random>
#include <set>
#include <stdexcept>

using namespace warp;

static const int chooseDriver = setenv("WARP_CUDA_DRIVER", WARP_FAKE_CUDA, 0);

namespace {
using Random = std::minstd_rand;
using Bytes = std::set<uint64_t>;
using Lists = std::vector<std::vector<int>>;
using Closure = std::vector<std::set<int>>;
} // namespace

static int below(Random &random, int count) { return int(random() % count); }

//===----------------------------------------------------------------------===//
// Edges
//===----------------------------------------------------------------------===//

static void collect(const MemoryBlock &block, Bytes &bytes, int dim = 0,
                    uint64_t offset = 0) {
  if (dim == block.rank) {
    for (int64_t i = 0; i < block.item; ++i)
      bytes.insert(block.start + offset + i);
    return;
  }
  const MemoryBlock::Dim &d = block.dims[dim];
  for (int64_t k = 0; k < d.count; ++k)
    collect(block, bytes, dim + 1, offset + d.stride * d.step * k);
}

/// Bytes that a node reads and writes.
static std::pair<Bytes, Bytes> bytesOf(const NodeRecord &record) {
  std::pair<Bytes, Bytes> result;
  for (const NodeAccess &access : record.accesses)
    for (const MemoryBlock &block : access.region.blocks)
      collect(block, access.writes ? result.second : result.first);
  return result;
}

static bool meet(const Bytes &a, const Bytes &b) {
  return std::any_of(a.begin(), a.end(),
                     [&](uint64_t byte) { return b.count(byte) != 0; });
}

/// Rows, columns and single elements of 8 x 8 numbers of 4 bytes.
static NodeAccess makeAccess(Random &random) {
  MemoryBlock block;
  block.item = 4;
  block.start = 4 * below(random, 8) + 32 * below(random, 8);
  int kind = below(random, 3);
  if (kind == 1)
    block.dims[block.rank++] = {32, 1 + below(random, 2), 2 + below(random, 2)};
  if (kind == 2)
    block.dims[block.rank++] = {4, 1 + below(random, 3), 2 + below(random, 2)};
  return {{{block}}, below(random, 2) == 0, "x"};
}

static NodeRecord makeRecord(Random &random) {
  NodeRecord record;
  for (int i = below(random, 4); i >= 0; --i)
    record.accesses.push_back(makeAccess(random));
  if (below(random, 12) == 0)
    record.barrier = "of somebody else";
  return record;
}

/// Nodes of several streams that now and then wait for each other.
static Lists makeStreams(Random &random, int count) {
  Lists before(count);
  std::vector<int> last(1 + below(random, 3), -1);
  for (int node = 0; node < count; ++node) {
    int stream = below(random, int(last.size()));
    std::set<int> set;
    if (last[stream] >= 0)
      set.insert(last[stream]);
    int other = below(random, int(last.size()));
    if (below(random, 4) == 0 && last[other] >= 0)
      set.insert(last[other]);
    before[node].assign(set.begin(), set.end());
    last[stream] = node;
  }
  return before;
}

static Closure closureOf(const Lists &before) {
  Closure closure;
  for (const std::vector<int> &list : before) {
    std::set<int> &all = closure.emplace_back();
    for (int from : list) {
      all.insert(from);
      all.insert(closure[from].begin(), closure[from].end());
    }
  }
  return closure;
}

static Lists listsOf(const std::vector<std::vector<GraphSchedule::Edge>> &all) {
  Lists lists;
  for (const auto &edges : all) {
    lists.emplace_back();
    for (const GraphSchedule::Edge &edge : edges)
      lists.back().push_back(edge.from);
  }
  return lists;
}

/// True if nodes must keep the order that they were recorded in.
static bool conflict(const NodeRecord &a, const NodeRecord &b) {
  if (!a.barrier.empty() || !b.barrier.empty())
    return true;
  auto [aRead, aWritten] = bytesOf(a);
  auto [bRead, bWritten] = bytesOf(b);
  return meet(aWritten, bWritten) || meet(aWritten, bRead) ||
         meet(aRead, bWritten);
}

static void checkOrder(const std::vector<NodeRecord> &records,
                       const Lists &recorded, const Lists &ordered) {
  Closure old = closureOf(recorded), now = closureOf(ordered);
  for (size_t node = 0; node < records.size(); ++node) {
    for (int from : old[node])
      if (conflict(records[from], records[node]))
        ASSERT_TRUE(now[node].count(from)) << from << " -> " << node;
    for (int from : ordered[node]) {
      ASSERT_TRUE(old[node].count(from)) << from << " -> " << node;
      for (int other : ordered[node])
        ASSERT_FALSE(now[other].count(from)) << "superfluous " << from;
    }
  }
}

// Every pair of nodes that share a byte which one of them writes keeps its
// order, if it had one; no other order comes in; and no edge is superfluous.
TEST(GraphOrder, KeepsTheOrderOfWhatMeets) {
  size_t fewer = 0;
  for (int round = 0; round < 300; ++round) {
    Random random(round + 1);
    int count = 2 + below(random, 30);
    Lists recorded = makeStreams(random, count);
    std::vector<NodeRecord> records;
    for (int i = 0; i < count; ++i)
      records.push_back(makeRecord(random));
    Lists ordered = listsOf(orderNodes(records, recorded, {}));
    checkOrder(records, recorded, ordered);
    size_t pairs = 0, before = 0;
    for (const auto &set : closureOf(ordered))
      pairs += set.size();
    for (const auto &set : closureOf(recorded))
      before += set.size();
    fewer += pairs < before;
  }
  EXPECT_GT(fewer, 200u);
}

// Nodes that fill the device keep their order; those that do not have company,
// up to the number of branches.
TEST(GraphOrder, LimitsBranches) {
  GraphCapacity capacity;
  capacity.threads = 1000;
  capacity.branches = 3;
  std::vector<NodeRecord> records(8);
  records[1].threads = records[4].threads = 1000;
  Lists recorded(8);
  for (int i = 1; i < 8; ++i)
    recorded[i] = {i - 1};
  Lists ordered = listsOf(orderNodes(records, recorded, capacity));
  EXPECT_EQ(ordered[1], std::vector<int>{});
  EXPECT_EQ(ordered[2], std::vector<int>{});
  EXPECT_EQ(ordered[4], std::vector<int>{1});
  std::set<int> tails;
  for (int i = 0; i < 8; ++i) {
    for (int from : ordered[i])
      tails.erase(from);
    tails.insert(i);
    EXPECT_LE(tails.size(), 3u);
  }
}

// The faster way is chosen by pairs of times, and again when others come or go;
// a few disturbed times, or a gain that is noise, choose nothing.
TEST(BranchTrial, ChoosesTheFasterWay) {
  BranchTrial trial;
  auto replay = [&](auto &&timeOf) {
    int64_t number = trial.begin();
    if (BranchTrial::isTrial(number))
      trial.record(number, timeOf(number, trial.uses(number)));
    return trial.uses(number);
  };
  auto run = [&](auto &&timeOf) {
    bool uses = false;
    for (int64_t i = 0; i < BranchTrial::period; ++i)
      uses = replay(timeOf);
    return uses;
  };
  EXPECT_FALSE(run([](int64_t, bool uses) { return uses ? 97 : 100; }));
  EXPECT_TRUE(run([](int64_t, bool uses) { return uses ? 60 : 100; }));
  // Some plain replays are disturbed, and branches are no faster.
  EXPECT_FALSE(run([](int64_t number, bool uses) {
    return uses ? 100 : number % 16 < 12 ? 100 : 400;
  }));
  // One undisturbed replay with branches on a loaded machine.
  EXPECT_FALSE(run([](int64_t number, bool uses) {
    return uses ? (number % BranchTrial::period < 4 ? 50 : 300) : 100;
  }));
  EXPECT_TRUE(run([](int64_t, bool uses) { return uses ? 60 : 100; }));
}

// Threads run each node once, behind those that it comes behind; an exception
// of a node is that of the run.
TEST(GraphBranches, RunNodesBehindTheirPredecessors) {
  int wide = 0;
  for (int round = 0; round < 200; ++round) {
    Random random(round + 1);
    int count = 2 + below(random, 100), first = below(random, count / 2);
    Lists recorded(count);
    std::vector<NodeRecord> records;
    for (int i = 0; i < count; ++i) {
      records.push_back(makeRecord(random));
      if (i)
        recorded[i] = {i - 1};
    }
    auto schedule = makeSchedule(records, recorded, {});
    GraphBranches branches(*schedule, first, count);
    wide += branches.width() > 1;
    std::vector<std::atomic<int>> done(count);
    std::atomic<int> early{0};
    branches.run([&](size_t node) {
      for (const GraphSchedule::Edge &edge : schedule->nodes[node].before)
        early += edge.from >= first && !done[edge.from];
      ++done[node];
    });
    EXPECT_EQ(early, 0);
    for (int i = 0; i < count; ++i)
      ASSERT_EQ(done[i], i >= first);
    int failing = first + below(random, count - first);
    EXPECT_THROW(branches.run([&](size_t node) {
      if (int(node) == failing)
        throw std::runtime_error("stop");
    }),
                 std::runtime_error);
  }
  EXPECT_GT(wide, 150);
}

//===----------------------------------------------------------------------===//
// Captures
//===----------------------------------------------------------------------===//

namespace {

constexpr int rows = 6, columns = 5, cells = rows * columns;

/// Two arrays, the first with room for another stream, and a condition.
struct Arrays {
  Buffer first{0, 4 * (cells + 4)}, second{0, 4 * cells}, flag{0, 4};

  static int *numbers(Buffer &buffer) {
    return static_cast<int *>(buffer.data());
  }
  void reset() {
    for (int i = 0; i < cells + 4; ++i)
      numbers(first)[i] = i;
    std::fill_n(numbers(second), cells, 7);
    *numbers(flag) = 0;
  }
  std::vector<int> contents() {
    std::vector<int> all(numbers(first), numbers(first) + cells + 4);
    all.insert(all.end(), numbers(second), numbers(second) + cells);
    return all;
  }
};

/// Random copies and fills of parts of the arrays, in bodies of branches and on
/// other streams, too.
class Program {
public:
  Program(unsigned seed, Arrays &arrays) : random(seed), arrays(arrays) {}

  /// `capture` is null to run it at once.
  void run(Capture *capture) {
    for (int i = 0; i < 24; ++i) {
      int kind = below(random, 12);
      if (kind < 10)
        makeCall()();
      else if (kind == 10)
        branch(capture);
      else
        fork();
    }
  }

private:
  ArrayDescriptor makeView() {
    ArrayDescriptor array;
    Buffer &buffer = below(random, 2) ? arrays.first : arrays.second;
    int row = below(random, rows - 1), column = below(random, columns - 2);
    array.data = Arrays::numbers(buffer) + row * columns + column;
    array.ndim = 2;
    array.shape[0] = array.shape[1] = 2;
    array.strides[0] = columns * 4;
    array.strides[1] = below(random, 2) ? 4 : 8;
    return array;
  }
  std::function<void()> makeCall() {
    int value = below(random, 1000), kind = below(random, 4);
    ArrayDescriptor to = makeView(), from = makeView();
    return [=] {
      if (kind == 0)
        fillArray({&to, 0}, &value, 4);
      else if (kind == 1)
        fillMemory(to.data, 0, &value, 4, 2);
      else if (kind == 2 && std::abs(static_cast<char *>(to.data) -
                                     static_cast<char *>(from.data)) >= 8)
        copyMemory(to.data, 0, from.data, 0, 8);
      else
        copyArray({&to, 0}, {&from, 0}, 4);
    };
  }
  void branch(Capture *capture) {
    int value = below(random, 2);
    bool negated = below(random, 2), runs = (value != 0) != negated;
    int *flag = Arrays::numbers(arrays.flag);
    fillMemory(flag, 0, &value, 4, 1);
    if (capture)
      capture->beginBody(capture->addCondition(flag, negated), false);
    for (int i = 0; i < 4; ++i)
      if (std::function<void()> call = makeCall(); capture || runs)
        call();
    if (capture)
      capture->endBody();
  }
  void fork() {
    Stream &side = *sides.emplace_back(std::make_unique<Stream>(0));
    Event begin(0), end(0);
    begin.record(*currentStream(0));
    waitEvent(side, begin);
    // Memory of its own, so that it does not matter who is first.
    int value = below(random, 1000);
    int *own = Arrays::numbers(arrays.first) + cells;
    fillMemory(own, 0, &value, 4, 2, &side);
    copyMemory(own + 2, 0, own, 0, 8, &side);
    makeCall()();
    end.record(side);
    waitEvent(*currentStream(0), end);
  }

  Random random;
  Arrays &arrays;
  std::vector<std::unique_ptr<Stream>> sides;
};

class OrderedGraphs : public testing::Test {
protected:
  void SetUp() override {
    ASSERT_EQ(chooseDriver, 0);
    if (std::string(getenv("WARP_CUDA_DRIVER")) != WARP_FAKE_CUDA)
      GTEST_SKIP() << "not the fake driver";
    ASSERT_NE(cudaDeviceCount(), 0);
    void *library = dlopen(WARP_FAKE_CUDA, RTLD_NOW | RTLD_LOCAL);
    setOrder = reinterpret_cast<void (*)(unsigned)>(
        dlsym(library, "fakeCudaSetGraphOrder"));
    ASSERT_TRUE(setOrder);
    early = reinterpret_cast<int (*)()>(
        dlsym(library, "fakeCudaProgrammaticEdges"));
    ASSERT_TRUE(early);
  }
  void TearDown() override {
    if (setOrder)
      setOrder(0);
  }

  std::shared_ptr<Graph> record(const std::function<void(Capture &)> &fill,
                                NodeOrder order = NodeOrder::Dependencies) {
    auto capture = Capture::begin(0, nullptr, CaptureMode::ThreadLocal, false,
                                  false, order);
    fill(*capture);
    return capture->end();
  }

  /// A graph leaves the memory that `expected` is, in whatever order its edges
  /// allow.
  void check(Graph &graph, Arrays &arrays, const std::vector<int> &expected,
             const std::string &name) {
    for (unsigned order = 0; order < 12; ++order) {
      setOrder(order);
      arrays.reset();
      graph.launch();
      ASSERT_EQ(arrays.contents(), expected) << name << ", order " << order;
    }
    setOrder(0);
  }

  void (*setOrder)(unsigned) = nullptr;
  /// Programmatic edges of the last graph.
  int (*early)() = nullptr;
};

} // namespace

TEST_F(OrderedGraphs, HaveTheBitsOfEagerCalls) {
  size_t reordered = 0;
  for (unsigned seed = 1; seed <= 60; ++seed) {
    Arrays arrays;
    arrays.reset();
    Program(seed, arrays).run(nullptr);
    std::vector<int> expected = arrays.contents();
    Program program(seed, arrays);
    std::shared_ptr<Graph> graph =
        record([&](Capture &capture) { program.run(&capture); });
    ASSERT_TRUE(graph->schedule());
    EXPECT_EQ(graph->schedule()->kept, "");
    reordered += graph->schedule()->branches > 1;
    check(*graph, arrays, expected, "program " + std::to_string(seed));
  }
  EXPECT_GT(reordered, 50u);
}

// A graph that is launched in a capture is one node, or several with branches;
// they come behind what they need alone.
TEST_F(OrderedGraphs, HoldGraphs) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    Arrays arrays;
    Program inner(seed, arrays), first(seed + 100, arrays),
        second(seed + 200, arrays);
    std::shared_ptr<Graph> part =
        record([&](Capture &capture) { inner.run(&capture); });
    std::shared_ptr<Graph> graph = record([&](Capture &capture) {
      first.run(&capture);
      part->launch();
      second.run(&capture);
    });
    arrays.reset();
    for (unsigned offset : {100, 0, 200})
      Program(seed + offset, arrays).run(nullptr);
    std::vector<int> expected = arrays.contents();
    check(*graph, arrays, expected, "program " + std::to_string(seed));
  }
}

// Changes that the body of a loop makes are seen by what follows, and by its
// next turn.
TEST_F(OrderedGraphs, KeepLoops) {
  Arrays arrays;
  int *list = Arrays::numbers(arrays.first);
  int *other = Arrays::numbers(arrays.second);
  int one = 1, zero = 0;
  auto fill = [&](Capture &capture) {
    fillMemory(list, 0, &one, 4, 4);
    fillMemory(list + 4, 0, &zero, 4, 1);
    fillMemory(other, 0, &zero, 4, 20);
    auto loop = capture.addCondition(list, false);
    capture.beginBody(loop, true);
    copyMemory(other + 1, 0, other, 0, 0);
    copyMemory(other + 10, 0, list + 1, 0, 16);
    copyMemory(list, 0, other + 10, 0, 16);
    fillMemory(other, 0, &one, 4, 1);
    capture.updateCondition(loop, list, false);
    capture.endBody();
    copyMemory(other + 5, 0, list, 0, 16);
    copyMemory(other + 4, 0, other, 0, 4);
  };
  std::shared_ptr<Graph> graph = record(fill);
  arrays.reset();
  std::vector<int> expected = arrays.contents();
  std::fill_n(expected.begin(), 5, 0);
  auto second = expected.begin() + cells + 4;
  std::fill_n(second, 20, 0);
  second[0] = second[4] = 1;
  check(*graph, arrays, expected, "loop");
  std::shared_ptr<const GraphSchedule> body;
  for (const GraphSchedule::Node &node : graph->schedule()->nodes)
    if (node.body)
      body = node.body;
  ASSERT_TRUE(body);
  // The copy of no bytes is none.
  EXPECT_EQ(body->nodes.size(), 4u);
  EXPECT_EQ(body->branches, 2);
}

// Without the option, and for captures of others, edges stay as they are.
TEST_F(OrderedGraphs, AreChainsWithoutTheOption) {
  Arrays arrays;
  auto fill = [&](Capture &) {
    setMemory(arrays.first.data(), 0, 1, 8);
    copyMemory(arrays.second.data(), 0, arrays.flag.data(), 0, 4);
  };
  EXPECT_FALSE(record(fill, NodeOrder::Recorded)->schedule());
  std::shared_ptr<const GraphSchedule> schedule = record(fill)->schedule();
  ASSERT_TRUE(schedule);
  EXPECT_EQ(schedule->recordedEdges, 1u);
  EXPECT_EQ(schedule->edges, 0u);
  EXPECT_EQ(schedule->branches, 2);
}

// Fills that wait for the same are one node, of any bytes that repeat every 16;
// those that overlap, have other bytes, or are large are nodes of their own.
TEST_F(OrderedGraphs, JoinFills) {
  constexpr size_t size = 3000, large = size_t(4) << 20;
  Buffer memory(0, size), other(0, 64), rest(0, large);
  auto *bytes = static_cast<char *>(memory.data());
  auto put = [&](size_t at, const std::string &unit, size_t count) {
    fillMemory(bytes + at, 0, unit.data(), unit.size(), count);
  };
  auto fills = [&](Capture *) {
    put(1, "x", 5);
    put(7, "ab", 40);
    put(101, "abcd", 20);
    put(203, "abcdefgh", 11);
    put(400, "0123456789abcdef", 40);
    put(1100, "aaaaaaaaaaaa", 100);
    // Behind the first one.
    put(0, "yz", 1);
    // Bytes that repeat every 12.
    put(2400, "abcdefghijkl", 5);
    copyMemory(other.data(), 0, bytes + 400, 0, 64);
    setMemory(rest.data(), 0, 1, large);
    setMemory(rest.data(), 0, 2, 1);
  };
  std::memset(bytes, '-', size);
  fills(nullptr);
  std::string expected(bytes, size);
  std::shared_ptr<Graph> graph =
      record([&](Capture &capture) { fills(&capture); });
  std::vector<std::string> names;
  for (const GraphSchedule::Node &node : graph->schedule()->nodes)
    names.push_back(node.name);
  EXPECT_EQ(names, (std::vector<std::string>{"6 fills", "fill", "copy", "fill",
                                             "2 fills"}));
  for (unsigned order = 0; order < 12; ++order) {
    setOrder(order);
    std::memset(bytes, '-', size);
    graph->launch();
    ASSERT_EQ(std::string(bytes, size), expected) << "order " << order;
    ASSERT_EQ(std::memcmp(other.data(), bytes + 400, 64), 0);
    ASSERT_EQ(static_cast<char *>(rest.data())[0], 2);
  }
  setFusesLaunches(false);
  graph = record([&](Capture &capture) { fills(&capture); });
  setFusesLaunches(true);
  EXPECT_EQ(graph->schedule()->nodes.size(), 11u);
}

// A table has 64 of them, and an order that no edge forbids is kept: the later
// of two fills of the same memory wins.
TEST_F(OrderedGraphs, JoinManyFills) {
  constexpr int count = 200;
  Buffer memory(0, 4 * count);
  auto *numbers = static_cast<int *>(memory.data());
  std::shared_ptr<Graph> graph = record([&](Capture &) {
    for (int i = 0; i < 2 * count; ++i)
      fillMemory(numbers + i % count, 0, &i, 4, 1);
  });
  size_t nodes = graph->schedule()->nodes.size();
  // Four and four tables.
  EXPECT_EQ(nodes, 8u);
  EXPECT_EQ(graph->size(), nodes);
  for (unsigned order = 0; order < 12; ++order) {
    setOrder(order);
    std::fill_n(numbers, count, -1);
    graph->launch();
    for (int i = 0; i < count; ++i)
      ASSERT_EQ(numbers[i], count + i) << "order " << order;
  }
}

static const char *const addText = R"(
func.func @add(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.arg_names = ["x", "y"]} {
  %i = warp.tid : si32
  %a = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %b = warp.load %y[%i] : !warp.array<1 x f32>, si32 -> f32
  %c = warp.add(%a, %b) : (f32, f32) -> f32
  warp.store %c, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}
)";

namespace {
/// Launches of a kernel that adds an array of 64 floats to another one.
class Additions {
public:
  Additions() : kernel(Module::fromText(addText), "add"), memory(0, 8 * 256) {}

  struct Block {
    LaunchHeader header;
    ArrayDescriptor x, y;
  };

  void launch(int from, int to, int threads, const Stream *stream = nullptr) {
    Block block;
    for (auto [array, place] : {std::pair(&block.x, from), {&block.y, to}}) {
      array->data = static_cast<char *>(memory.data()) + 256 * place;
      array->ndim = 1;
      array->shape[0] = 64;
      array->strides[0] = 4;
    }
    LaunchDim dim;
    dim.extent[0] = threads;
    kernel.launch(0, dim, &block, stream);
  }

  Kernel kernel;
  Buffer memory;
};
} // namespace

// A kernel may start while its only predecessor ends, also one that it was not
// recorded behind; with several predecessors it comes after their ends.
TEST_F(OrderedGraphs, StartKernelsEarlyBehindOne) {
  Additions add;
  auto fill = [&](Capture &) {
    // Launches of equal extents would be one.
    add.launch(0, 1, 64);
    add.launch(0, 2, 48);
    add.launch(1, 3, 32);
    add.launch(2, 4, 16);
    add.launch(3, 4, 8);
  };
  record(fill, NodeOrder::Recorded);
  EXPECT_EQ(early(), 4);
  std::shared_ptr<Graph> graph = record(fill);
  // 0 -> 2, 1 -> 3; 2 and 3 -> 4.
  EXPECT_EQ(graph->schedule()->edges, 4u);
  EXPECT_EQ(graph->schedule()->nodes[4].before.size(), 2u);
  EXPECT_EQ(early(), 2);
}

// Nothing starts early behind a kernel that stands for fills, nor does it, and
// nothing waits for a fill that could begin later than the others.
TEST_F(OrderedGraphs, BeginFillsTogether) {
  Additions add;
  auto at = [&](int place) {
    return static_cast<char *>(add.memory.data()) + 256 * place;
  };
  std::shared_ptr<Graph> graph = record([&](Capture &) {
    add.launch(0, 1, 64);
    setMemory(at(2), 0, 0, 256);
    setMemory(at(3), 0, 0, 256);
    add.launch(2, 3, 48);
    // Behind the first launch, where the second one need not wait.
    setMemory(at(1), 0, 0, 256);
    // Recorded behind a fill, and behind the second launch alone.
    add.launch(3, 4, 32);
  });
  const std::vector<GraphSchedule::Node> &nodes = graph->schedule()->nodes;
  ASSERT_EQ(nodes.size(), 5u);
  EXPECT_EQ(nodes[1].name, "2 fills");
  ASSERT_EQ(nodes[2].before.size(), 1u);
  EXPECT_EQ(nodes[2].before[0].from, 1);
  EXPECT_EQ(early(), 1);
}

// All else comes behind fills that wait for nothing, if that leaves two nodes
// with one predecessor less, which may then start early.
TEST_F(OrderedGraphs, BeginWithFillsThatSaveJoins) {
  Additions add;
  auto at = [&](int place) {
    return static_cast<char *>(add.memory.data()) + 256 * place;
  };
  for (bool saves : {false, true}) {
    std::shared_ptr<Graph> graph = record([&](Capture &) {
      add.launch(0, 1, 64);
      setMemory(at(2), 0, 0, 256);
      setMemory(at(3), 0, 0, 256);
      add.launch(1, 2, 48);
      add.launch(saves ? 1 : 4, 3, 32);
    });
    const std::vector<GraphSchedule::Node> &nodes = graph->schedule()->nodes;
    ASSERT_EQ(nodes.size(), 4u);
    EXPECT_EQ(nodes[saves ? 0 : 1].name, "2 fills");
    EXPECT_EQ(nodes[0].before.size(), 0u);
    EXPECT_EQ(nodes[1].before.size(), saves ? 1u : 0u);
    EXPECT_EQ(nodes[2].before.size(), saves ? 1u : 2u);
    EXPECT_EQ(nodes[3].before.size(), 1u);
    EXPECT_EQ(early(), saves ? 2 : 0);
  }
}

namespace {
/// Launches of `Additions` add in graphs of the fake driver while it lives.
class RealAdditions : public Additions {
public:
  RealAdditions() {
    set(
        [](const void *bytes) {
          Block block;
          std::memcpy(&block, bytes, sizeof(block));
          for (int i = 0; i < block.header.dim[0]; ++i)
            static_cast<float *>(block.y.data)[i] +=
                static_cast<float *>(block.x.data)[i];
        },
        sizeof(Block));
  }
  ~RealAdditions() { set(nullptr, 0); }
  float &first(int place) {
    return static_cast<float *>(memory.data())[64 * place];
  }

private:
  static void set(void (*effect)(const void *), size_t bytes) {
    reinterpret_cast<void (*)(void (*)(const void *), size_t)>(dlsym(
        dlopen(WARP_FAKE_CUDA, RTLD_NOW), "fakeCudaSetEffect"))(effect, bytes);
  }
};
} // namespace

// A kernel of another library that starts early and never waits may end before
// its predecessor: what comes behind it comes behind both.
TEST_F(OrderedGraphs, WaitForTheEndBesideKernelsOfOthers) {
  RealAdditions add;
  struct {
    unsigned grid[3] = {1, 1, 1}, block[3] = {1, 1, 1}, sharedBytes = 0;
    void *stream;
    const int *attributes;
    unsigned count = 1;
  } config;
  const int attributes[] = {6, 0, 1};
  config.attributes = attributes;
  config.stream = currentStream(0)->handle();
  auto *launch =
      reinterpret_cast<int (*)(const void *, void *, void **, void **)>(
          dlsym(dlopen(WARP_FAKE_CUDA, RTLD_NOW), "cuLaunchKernelEx"));
  std::string code = ".visible .entry other() { ret; }";
  std::vector<char> nothing(1024);
  void *arguments[] = {nothing.data()};
  std::shared_ptr<Graph> graph = record([&](Capture &) {
    add.launch(0, 1, 64);
    ASSERT_EQ(launch(&config, &code, arguments, nullptr), 0);
    add.launch(1, 2, 48);
  });
  EXPECT_EQ(graph->schedule()->nodes.size(), 3u);
  for (unsigned order = 0; order < 12; ++order) {
    setOrder(order);
    add.first(0) = 1;
    add.first(1) = 2;
    add.first(2) = 3;
    graph->launch();
    ASSERT_EQ(add.first(2), 6) << "order " << order;
  }
}

// A condition is set once fills that are one have ended.
TEST_F(OrderedGraphs, SetConditionsBehindFills) {
  RealAdditions add;
  Buffer flags(0, 8);
  auto *flag = static_cast<int *>(flags.data());
  int one = 1, zero = 0;
  for (bool first : {false, true}) {
    std::shared_ptr<Graph> graph = record([&](Capture &capture) {
      if (first)
        add.launch(0, 4, 16);
      fillMemory(flag, 0, &one, 4, 1);
      setMemory(&add.first(1), 0, 0, 256);
      if (first)
        setMemory(&add.first(5), 0, 0, 256);
      // Two nodes that would wait for the first launch and for fills.
      if (first)
        add.launch(4, 5, 48);
      add.launch(first ? 4 : 0, 1, 64);
      auto loop = capture.addCondition(flag, false);
      capture.beginBody(loop, true);
      setMemory(&add.first(2), 0, 0, 256);
      fillMemory(flag, 0, &zero, 4, 1);
      add.launch(1, 2, 64);
      capture.updateCondition(loop, flag, false);
      capture.endBody();
      add.launch(2, 3, 32);
    });
    EXPECT_EQ(graph->schedule()->nodes[0].name, first ? "3 fills" : "2 fills");
    for (unsigned order = 0; order < 12; ++order) {
      setOrder(order);
      *flag = 0;
      add.first(0) = 5;
      add.first(2) = 100;
      add.first(3) = 1;
      add.first(4) = 0;
      graph->launch();
      ASSERT_EQ(add.first(3), 6) << "order " << order;
      ASSERT_EQ(*flag, 0);
    }
  }
}

// Launches whose threads keep to elements of their own are one node, also in
// bodies, and in graphs that are compared with their recording.
TEST_F(OrderedGraphs, FuseLaunches) {
  Additions add;
  auto chain = [&](Capture &) {
    add.launch(0, 1, 64);
    add.launch(1, 2, 64);
    add.launch(2, 3, 32);
    add.launch(3, 4, 32);
  };
  EXPECT_EQ(record(chain, NodeOrder::Recorded)->size(), 4u);
  for (NodeOrder order : {NodeOrder::Dependencies, NodeOrder::Verified}) {
    std::shared_ptr<Graph> graph = record(chain, order);
    EXPECT_EQ(graph->size(), 2u);
    ASSERT_EQ(graph->schedule()->nodes.size(), 2u);
    EXPECT_EQ(graph->schedule()->nodes[0].name, "add + add");
    EXPECT_EQ(graph->schedule()->nodes[1].parts.size(), 2u);
    EXPECT_EQ(graph->schedule()->edges, 1u);
    graph->launch();
  }
  Buffer flag(0, 4);
  auto *value = static_cast<const int32_t *>(flag.data());
  std::shared_ptr<Graph> graph = record([&](Capture &capture) {
    auto branch = capture.addCondition(value, false);
    capture.beginBody(branch, false);
    chain(capture);
    capture.endBody();
    add.launch(4, 5, 64);
    add.launch(5, 6, 64);
  });
  const std::vector<GraphSchedule::Node> &nodes = graph->schedule()->nodes;
  EXPECT_EQ(nodes.back().parts.size(), 2u);
  auto body = std::find_if(nodes.begin(), nodes.end(),
                           [](const auto &node) { return bool(node.body); });
  ASSERT_NE(body, nodes.end());
  EXPECT_EQ(body->body->nodes.size(), 2u);
  graph->launch();
}

// Launches of several streams stay as they were recorded, and so do all if
// nobody wants them fused.
TEST_F(OrderedGraphs, FuseLaunchesOfOneStream) {
  Additions add;
  Stream side(0);
  std::shared_ptr<Graph> graph = record([&](Capture &) {
    Event begin(0), end(0);
    begin.record(*currentStream(0));
    waitEvent(side, begin);
    add.launch(0, 1, 64);
    add.launch(1, 2, 64);
    add.launch(3, 4, 64, &side);
    add.launch(4, 5, 64, &side);
    end.record(side);
    waitEvent(*currentStream(0), end);
  });
  EXPECT_EQ(graph->size(), 4u);
  setFusesLaunches(false);
  graph = record([&](Capture &) {
    add.launch(0, 1, 64);
    add.launch(1, 2, 64);
  });
  setFusesLaunches(true);
  EXPECT_EQ(graph->size(), 2u);
  EXPECT_TRUE(graph->schedule()->nodes[1].parts.empty());
}

// Verified graphs run both orders, each from the memory that was there; copies
// from the host and to it count, too.
TEST_F(OrderedGraphs, AreVerified) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    Arrays arrays;
    arrays.reset();
    Program(seed, arrays).run(nullptr);
    std::vector<int> expected = arrays.contents(), source(4, 3), target(4);
    Program program(seed, arrays);
    std::shared_ptr<Graph> graph = record(
        [&](Capture &capture) {
          program.run(&capture);
          int *room = Arrays::numbers(arrays.first) + cells;
          copyMemory(target.data(), cpuDevice, room, 0, 16);
          copyMemory(room, 0, source.data(), cpuDevice, 16);
        },
        NodeOrder::Verified);
    std::vector<int> before(expected.begin() + cells,
                            expected.begin() + cells + 4);
    std::fill_n(expected.begin() + cells, 4, 3);
    check(*graph, arrays, expected, "program " + std::to_string(seed));
    EXPECT_EQ(target, before);
  }
}

TEST(GraphVerify, NamesTheFirstDifference) {
  std::vector<int> numbers(4, 1);
  GraphTrace trace;
  trace.add(GraphOperation::Kind::FillBytes,
            graphs::FillBytes{numbers.data(), 4}, std::string(4, '\0'));
  auto set = [&](int place, int value) {
    return [&numbers, place, value] { numbers[place] += value; };
  };
  runBothOrders(cpuDevice, trace, set(1, 5), set(1, 5));
  EXPECT_EQ(numbers, (std::vector<int>{1, 6, 1, 1}));
  try {
    runBothOrders(cpuDevice, trace, set(1, 5), set(2, 5));
    FAIL();
  } catch (const Error &error) {
    EXPECT_EQ(error.message, "the optimized graph on 'cpu' differs from its "
                             "recording in memory, at byte 4 of 16");
  }
}

//===- graph-order-test.cpp - Dependency DAGs of records of accesses ------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The edges are compared with those that sets of single bytes ask for.
//
//===----------------------------------------------------------------------===//

#include "OrderedGraphs.h"

#include "Runtime/GraphOrder.h"
#include "Runtime/GraphVerify.h"
#include "Runtime/cpu/BranchTrial.h"
#include "Runtime/cpu/GraphBranches.h"

#include <algorithm>
#include <atomic>
#include <set>
#include <stdexcept>

using namespace warp;

namespace {
using Bytes = std::set<uint64_t>;
using Lists = std::vector<std::vector<int>>;
using Closure = std::vector<std::set<int>>;
} // namespace

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

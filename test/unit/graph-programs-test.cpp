//===- graph-programs-test.cpp - Captures of random programs --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Captures run against the fake driver, in several orders that the edges allow,
// and are compared with the same calls without a capture.
//
//===----------------------------------------------------------------------===//

#include "OrderedGraphs.h"

#include <algorithm>

using namespace warp;

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

/// Random copies and fills of parts of the arrays, in bodies of branches and
/// loops and on other streams, too.
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
    bool isLoop = below(random, 2);
    int *flag = Arrays::numbers(arrays.flag);
    fillMemory(flag, 0, &value, 4, 1);
    Capture::Condition condition = 0;
    if (capture) {
      condition = capture->addCondition(flag, negated);
      capture->beginBody(condition, isLoop);
    }
    for (int i = 0; i < 4; ++i)
      if (std::function<void()> call = makeCall(); capture || runs)
        call();
    if (!capture)
      return;
    // A loop has one turn at most.
    int last = negated;
    if (isLoop) {
      fillMemory(flag, 0, &last, 4, 1);
      capture->updateCondition(condition, flag, negated);
    }
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

class GraphPrograms : public OrderedGraphs {
protected:
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
};

} // namespace

TEST_F(GraphPrograms, HaveTheBitsOfEagerCalls) {
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
TEST_F(GraphPrograms, HoldGraphs) {
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
TEST_F(GraphPrograms, KeepLoops) {
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
TEST_F(GraphPrograms, AreChainsWithoutTheOption) {
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

// Verified graphs run both orders, each from the memory that was there; copies
// from the host and to it count, too.
TEST_F(GraphPrograms, AreVerified) {
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

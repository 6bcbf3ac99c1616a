//===- graph-peel-test.cpp - Loops of captured graphs that run once -------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "OrderedGraphs.h"

#include <algorithm>

using namespace warp;

namespace {

/// A loop whose turns shift a list of flags, so that it has as many turns as
/// the list has ones ahead of a zero; and count themselves.
class GraphPeel : public OrderedGraphs {
protected:
  static constexpr int length = 6;
  Buffer list{0, 4 * length}, moved{0, 4 * length}, seen{0, 4 * length};

  int *flags() { return static_cast<int *>(list.data()); }
  int *copy() { return static_cast<int *>(seen.data()); }

  void turn() {
    copyMemory(moved.data(), 0, flags() + 1, 0, 4 * (length - 1));
    copyMemory(list.data(), 0, moved.data(), 0, 4 * (length - 1));
    copyMemory(copy() + 1, 0, copy(), 0, 4);
  }
  void loop(Capture &capture, bool negated = false,
            const std::function<void()> &inside = {}) {
    auto condition = capture.addCondition(flags(), negated);
    capture.beginBody(condition, true);
    turn();
    if (inside)
      inside();
    capture.updateCondition(condition, flags(), negated);
    capture.endBody();
  }
  void fill(int *where, int value, size_t count = 1) {
    fillMemory(where, 0, &value, 4, count);
  }
  static bool isPeeled(const Graph &graph) {
    const std::vector<GraphSchedule::Node> &nodes = graph.schedule()->nodes;
    return std::any_of(nodes.begin(), nodes.end(), [](const auto &node) {
      return node.name.find("second turn") != std::string::npos;
    });
  }
};

} // namespace

// The first turn is ahead of the loop, in whatever order the edges allow, and
// the loop runs the others; no kernel sets the condition ahead of it.
TEST_F(GraphPeel, RunsTheFirstTurnAhead) {
  for (int turns = 1; turns < length; ++turns) {
    auto work = [&](Capture &capture) {
      fill(flags(), 1, size_t(turns));
      fill(flags() + turns, 0, size_t(length - turns));
      fill(copy(), turns);
      loop(capture);
      copyMemory(copy() + 2, 0, copy() + 1, 0, 4);
    };
    std::shared_ptr<Graph> graph = record(work);
    EXPECT_TRUE(isPeeled(*graph));
    size_t conditions = 0;
    for (const GraphSchedule::Node &node : graph->schedule()->nodes)
      conditions += node.name == "condition";
    EXPECT_EQ(conditions, 1u);
    for (unsigned order = 0; order < 12; ++order) {
      setOrder(order);
      std::fill_n(flags(), length, 7);
      std::fill_n(copy(), length, 0);
      graph->launch();
      ASSERT_EQ(flags()[0], 0) << turns << " turns, order " << order;
      // A zero has come from the end with each turn.
      ASSERT_EQ(std::count(flags(), flags() + length, 0), length);
      ASSERT_EQ(copy()[2], turns);
    }
    EXPECT_FALSE(record(work, NodeOrder::Recorded)->schedule());
  }
}

// A loop stays as it is where its condition may be zero, where something else
// may have set it, and where nobody wants launches to change.
TEST_F(GraphPeel, NeedsAConditionThatHolds) {
  auto peels = [&](const std::function<void(Capture &)> &work) {
    std::shared_ptr<Graph> graph = record(work);
    graph->launch();
    return isPeeled(*graph);
  };
  auto first = [&](int value) {
    return [this, value](Capture &capture) {
      fill(flags(), value, 1);
      fill(flags() + 1, 0, length - 1);
      loop(capture);
    };
  };
  EXPECT_TRUE(peels(first(5)));
  EXPECT_TRUE(peels(first(-1)));
  EXPECT_FALSE(peels(first(0)));
  setFusesLaunches(false);
  EXPECT_FALSE(peels(first(5)));
  setFusesLaunches(true);
  fill(flags(), 0, length);
  EXPECT_FALSE(peels([&](Capture &capture) { loop(capture); }));
  EXPECT_FALSE(peels([&](Capture &capture) {
    fill(flags(), 1, 1);
    // May write the condition, or another number.
    copyMemory(flags(), 0, flags() + 2, 0, 4);
    loop(capture);
  }));
  EXPECT_TRUE(peels([&](Capture &capture) {
    fill(flags(), 1, 1);
    copyMemory(flags() + 1, 0, flags() + 2, 0, 4);
    loop(capture);
  }));
  EXPECT_FALSE(peels([&](Capture &capture) {
    fill(flags(), 1, 1);
    // Two bytes of it.
    setMemory(flags(), 0, 0, 2);
    loop(capture);
  }));
  // Sixteen bits are a unit, of which the condition begins with the second.
  EXPECT_TRUE(peels([&](Capture &capture) {
    const char unit[] = {0, 0, 1, 0, 0, 0, 0, 0};
    fillMemory(flags(), 0, unit, 8, 1);
    fill(flags() + 1, 0, length - 1);
    loop(capture);
  }));
  EXPECT_FALSE(peels([&](Capture &capture) {
    const char unit[] = {0, 0, 0, 0, 1, 0, 0, 0};
    fillMemory(flags(), 0, unit, 8, 1);
    loop(capture);
  }));
}

// A condition that is negated holds for zero.
TEST_F(GraphPeel, NegatesConditions) {
  for (int value : {0, 1}) {
    std::shared_ptr<Graph> graph = record([&](Capture &capture) {
      fill(flags(), value, 1);
      fill(flags() + 1, 1, length - 1);
      fill(copy(), 3);
      loop(capture, /*negated=*/true);
    });
    EXPECT_EQ(isPeeled(*graph), value == 0);
    for (unsigned order = 0; order < 12; ++order) {
      setOrder(order);
      std::fill_n(copy(), length, 0);
      graph->launch();
      ASSERT_EQ(copy()[1], value == 0 ? 3 : 0);
    }
  }
}

// Bodies with branches stay in their loop; a loop in a body may be peeled.
TEST_F(GraphPeel, KeepsBodiesWithBranches) {
  Buffer outer(0, 4);
  auto *left = static_cast<int *>(outer.data());
  std::shared_ptr<Graph> graph = record([&](Capture &capture) {
    fill(left, 1);
    auto condition = capture.addCondition(left, false);
    capture.beginBody(condition, true);
    fill(flags(), 1, 2);
    fill(flags() + 2, 0, length - 2);
    fill(copy(), 9);
    loop(capture);
    fill(left, 0);
    capture.updateCondition(condition, left, false);
    capture.endBody();
  });
  EXPECT_FALSE(isPeeled(*graph));
  const GraphSchedule::Node &body = graph->schedule()->nodes.back();
  ASSERT_TRUE(body.body);
  EXPECT_TRUE(std::any_of(
      body.body->nodes.begin(), body.body->nodes.end(), [](const auto &node) {
        return node.name.find("second turn") != std::string::npos;
      }));
  for (unsigned order = 0; order < 12; ++order) {
    setOrder(order);
    *left = 0;
    std::fill_n(flags(), length, 7);
    std::fill_n(copy(), length, 0);
    graph->launch();
    ASSERT_EQ(std::count(flags(), flags() + length, 0), length);
    ASSERT_EQ(copy()[1], 9);
  }
}

// Launches of the first turn are fused with those ahead of the loop, and start
// while others end.
TEST_F(GraphPeel, FusesTheFirstTurn) {
  Additions add;
  auto count = [&](Capture &capture, int value) {
    fill(flags(), value, 1);
    add.launch(0, 1, 64);
    auto condition = capture.addCondition(flags(), false);
    capture.beginBody(condition, true);
    add.launch(1, 2, 64);
    add.launch(2, 3, 48);
    capture.updateCondition(condition, flags(), false);
    capture.endBody();
  };
  std::shared_ptr<Graph> graph =
      record([&](Capture &capture) { count(capture, 1); });
  EXPECT_EQ(graph->schedule()->nodes[1].name, "add + add");
  EXPECT_EQ(early(), 1);
  graph = record([&](Capture &capture) { count(capture, 0); });
  EXPECT_EQ(graph->schedule()->nodes[1].name, "add");
  EXPECT_EQ(early(), 0);
}

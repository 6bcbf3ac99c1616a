//===- graph-fills-test.cpp - Fills of captured graphs that are one -------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "OrderedGraphs.h"

#include <algorithm>

using namespace warp;

using GraphFills = OrderedGraphs;

// Fills that wait for the same are one node, of any bytes that repeat every 16;
// those that overlap, have other bytes, or are large are nodes of their own.
TEST_F(GraphFills, JoinFills) {
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
TEST_F(GraphFills, JoinManyFills) {
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

// Nothing starts early behind a kernel that stands for fills, nor does it, and
// nothing waits for a fill that could begin later than the others.
TEST_F(GraphFills, BeginFillsTogether) {
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
TEST_F(GraphFills, BeginWithFillsThatSaveJoins) {
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

// A condition is set once fills that are one have ended.
TEST_F(GraphFills, SetConditionsBehindFills) {
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

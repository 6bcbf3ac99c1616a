//===- graph-fusion-test.cpp - Launches of captured graphs ----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Launches that are one, and those that start while others end.
//
//===----------------------------------------------------------------------===//

#include "OrderedGraphs.h"

#include <algorithm>

using namespace warp;

using GraphLaunches = OrderedGraphs;

// A kernel may start while its only predecessor ends, also one that it was not
// recorded behind; with several predecessors it comes after their ends.
TEST_F(GraphLaunches, StartKernelsEarlyBehindOne) {
  RealAdditions add;
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
  for (unsigned order = 0; order < 12; ++order) {
    setOrder(order);
    for (int place = 0; place < 5; ++place)
      add.first(place) = float(1 << place);
    graph->launch();
    // 16 + (1 + 4) + (1 + 2 + 8).
    ASSERT_EQ(add.first(4), 32) << "order " << order;
  }
}

// A graph that the driver refuses gets the edges of its recording back, of
// either kind; one with fused launches keeps its edges, but no kernel of it
// starts early.
TEST_F(GraphLaunches, GetOtherEdgesIfTheDriverRefusesThem) {
  RealAdditions add;
  auto *refuse = reinterpret_cast<void (*)(int)>(
      dlsym(dlopen(WARP_FAKE_CUDA, RTLD_NOW), "fakeCudaRefuseGraphs"));
  ASSERT_TRUE(refuse);
  auto fill = [&](int threads, int others) {
    return [&add, threads, others](Capture &) {
      add.launch(0, 1, threads);
      add.launch(0, 2, others);
      add.launch(1, 3, others - 1);
      add.launch(2, 4, 16);
      add.launch(3, 4, 8);
    };
  };
  refuse(1);
  std::shared_ptr<Graph> graph = record(fill(64, 48));
  EXPECT_EQ(early(), 4);
  EXPECT_FALSE(graph->schedule()->kept.empty());
  for (unsigned order = 0; order < 12; ++order) {
    setOrder(order);
    for (int place = 0; place < 5; ++place)
      add.first(place) = float(1 << place);
    graph->launch();
    // 4 + (0 + 2) + (0 + 1 + 3).
    ASSERT_EQ(add.first(4), 32) << "order " << order;
  }
  refuse(1);
  graph = record(fill(64, 64));
  EXPECT_EQ(graph->size(), 4u);
  EXPECT_EQ(early(), 0);
  EXPECT_TRUE(graph->schedule()->kept.empty());
  refuse(2);
  EXPECT_THROW(record(fill(64, 48)), Error);
  refuse(0);
}

// A kernel of another library that starts early and never waits may end before
// its predecessor: what comes behind it comes behind both.
TEST_F(GraphLaunches, WaitForTheEndBesideKernelsOfOthers) {
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

// Launches whose threads keep to elements of their own are one node, also in
// bodies, and in graphs that are compared with their recording.
TEST_F(GraphLaunches, FuseLaunches) {
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
TEST_F(GraphLaunches, FuseLaunchesOfOneStream) {
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

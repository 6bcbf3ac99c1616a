//===- GraphBranches.cpp - Nodes of CPU graphs on several threads ---------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Nodes that are ready are bits; a thread takes the first one that it can
// clear, runs it, and goes on with a node that was waiting for it alone. No
// thread is needed for another one to go on, so one that loses its core holds
// up the node that it has, and nothing else. A thread without a node leaves
// after a while if another one has one, for the caller to look after the
// threads inside (Pool.h).
//
//===----------------------------------------------------------------------===//

#include "GraphBranches.h"

#include "warp/ThreadPool.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <memory>

using namespace warp;

/// Looks at the ready nodes before a thread leaves: some ten microseconds.
static constexpr int mostLooks = 1000;

GraphBranches::GraphBranches(const GraphSchedule &schedule, size_t first,
                             size_t last)
    : begin(first), followers(last - first), waits(last - first) {
  std::vector<int> level(last - first), width(last - first);
  for (size_t i = 0; i < followers.size(); ++i) {
    for (const GraphSchedule::Edge &edge : schedule.nodes[first + i].before) {
      if (size_t(edge.from) < first)
        continue;
      size_t from = edge.from - first;
      followers[from].push_back(int(i));
      ++waits[i];
      level[i] = std::max(level[i], level[from] + 1);
    }
    most = std::max(most, ++width[level[i]]);
  }
}

namespace {

/// One run of the nodes.
class Replay {
public:
  Replay(const std::vector<std::vector<int>> &followers,
         const std::vector<int> &waits,
         const std::function<void(int)> &runNode);
  /// By each thread.
  void work();

private:
  int take();
  int finish(int node);
  void makeReady(int node) {
    ready[node / 64].fetch_or(uint64_t(1) << node % 64,
                              std::memory_order_release);
  }

  const std::vector<std::vector<int>> &followers;
  const std::function<void(int)> &runNode;
  size_t words;
  std::unique_ptr<std::atomic<uint64_t>[]> ready;
  std::unique_ptr<std::atomic<int>[]> waits;
  /// Nodes that have not run, and threads that have one.
  std::atomic<int> left, busy{0};
};

} // namespace

Replay::Replay(const std::vector<std::vector<int>> &followers,
               const std::vector<int> &counts,
               const std::function<void(int)> &runNode)
    : followers(followers), runNode(runNode), words(counts.size() / 64 + 1),
      ready(new std::atomic<uint64_t>[words]()),
      waits(new std::atomic<int>[counts.size()]), left(int(counts.size())) {
  for (size_t i = 0; i < counts.size(); ++i) {
    waits[i].store(counts[i], std::memory_order_relaxed);
    if (!counts[i])
      makeReady(int(i));
  }
}

int Replay::take() {
  for (size_t i = 0; i < words; ++i) {
    uint64_t bits = ready[i].load(std::memory_order_acquire);
    while (bits) {
      uint64_t bit = bits & -bits;
      // Busy before the node is gone: else all might leave.
      busy.fetch_add(1);
      if (ready[i].fetch_and(~bit, std::memory_order_acq_rel) & bit)
        return int(i * 64) + std::countr_zero(bit);
      busy.fetch_sub(1);
      bits = ready[i].load(std::memory_order_acquire);
    }
  }
  return -1;
}

/// Gives the next node of the thread, or -1.
int Replay::finish(int node) {
  int next = -1;
  for (int follower : followers[node])
    if (waits[follower].fetch_sub(1, std::memory_order_acq_rel) == 1) {
      if (next < 0)
        next = follower;
      else
        makeReady(follower);
    }
  left.fetch_sub(1, std::memory_order_release);
  if (next < 0)
    busy.fetch_sub(1);
  return next;
}

void Replay::work() {
  int looks = 0;
  while (left.load(std::memory_order_acquire) > 0) {
    int node = take();
    if (node < 0) {
      if (++looks > mostLooks && busy.load() > 0)
        return;
#if defined(__x86_64__)
      __builtin_ia32_pause();
#endif
      continue;
    }
    looks = 0;
    try {
      while (node >= 0) {
        runNode(node);
        node = finish(node);
      }
    } catch (...) {
      // The others leave, too.
      left.store(0);
      throw;
    }
  }
}

void GraphBranches::run(const std::function<void(size_t)> &runNode) const {
  std::function<void(int)> runOne = [&](int node) { runNode(begin + node); };
  Replay replay(followers, waits, runOne);
  ThreadPool::runTogether(most, [&] { replay.work(); });
}

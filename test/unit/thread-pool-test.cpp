//===- thread-pool-test.cpp - Parallel loops on the CPU -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Runtime/PoolCpus.h"
#include "Runtime/WidthPolicy.h"
#include "warp/ThreadPool.h"

#include <atomic>
#include <chrono>
#include <climits>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <gtest/gtest.h>
#include <stdexcept>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>
#include <utility>
#include <vector>

using warp::ThreadPool;

// Every index is visited exactly once, for ranges around the grain and above.
TEST(ThreadPool, VisitsEveryIndexOnce) {
  for (int64_t size : {0, 1, 63, 64, 65, 1000, 65536, 1000003}) {
    std::vector<std::atomic<int>> seen(size);
    ThreadPool::parallelFor(5, 5 + size, 64, [&](int64_t begin, int64_t end) {
      for (int64_t i = begin; i < end; ++i)
        ++seen[i - 5];
    });
    for (auto &count : seen)
      ASSERT_EQ(count.load(), 1) << "size " << size;
  }
}

// No two threads have a number at the same time, nested loops included, and
// that of the caller is 0.
TEST(ThreadPool, NumbersItsThreads) {
  std::vector<std::atomic<int>> inside(ThreadPool::size());
  std::atomic<int> wrong{0};
  auto caller = std::this_thread::get_id();
  for (int round = 0; round < 50; ++round)
    ThreadPool::parallelFor(0, 4096, 1, [&](int64_t, int64_t) {
      int number = ThreadPool::worker();
      if (number < 0 || number >= ThreadPool::size()) {
        ++wrong;
        return;
      }
      wrong += inside[number]++ != 0;
      wrong += (number == 0) != (std::this_thread::get_id() == caller);
      ThreadPool::parallelFor(0, 10000, 1, [&](int64_t, int64_t) {
        wrong += ThreadPool::worker() != number;
      });
      --inside[number];
    });
  EXPECT_EQ(wrong.load(), 0);
  EXPECT_EQ(ThreadPool::worker(), 0);
}

TEST(ThreadPool, ChunksAreMultiplesOfTheGrain) {
  std::atomic<int> odd{0};
  ThreadPool::parallelFor(0, 100000, 64, [&](int64_t begin, int64_t end) {
    if (begin % 64 != 0 || (end != 100000 && (end - begin) % 64 != 0))
      ++odd;
  });
  EXPECT_EQ(odd.load(), 0);
}

// Learning changes widths and chunks, never the visited indices.
TEST(ThreadPool, HistoriesKeepEveryIndex) {
  warp::LoopHistory history;
  std::vector<int> seen(300000);
  for (int round = 1; round <= 300; ++round) {
    int64_t size = round % 3 ? 300000 : 1000 + round;
    auto visit = [&](int64_t begin, int64_t end) {
      EXPECT_TRUE(begin % 64 == 0 || size < 300000);
      for (int64_t i = begin; i < end; ++i)
        ++seen[i];
    };
    ThreadPool::parallelFor(0, size, 256, visit, &history);
    for (int64_t i = 0; i < 300000; ++i)
      ASSERT_EQ(std::exchange(seen[i], 0), i < size) << "round " << round;
  }
}

// Workers lose their cores with chunks in hand and are moved to the caller's.
TEST(ThreadPool, FinishesBesideBusyProcesses) {
  std::vector<pid_t> others;
  for (int i = 0; i < ThreadPool::size(); ++i) {
    pid_t child = fork();
    if (child == 0) {
      // The end of one that a failed test leaves behind.
      alarm(30);
      for (volatile bool forever = true; forever;) {
      }
    }
    others.push_back(child);
  }
  warp::LoopHistory history;
  std::vector<double> values(1 << 18);
  auto stop = std::chrono::steady_clock::now() + std::chrono::milliseconds(500);
  int rounds = 0;
  for (; std::chrono::steady_clock::now() < stop; ++rounds)
    ThreadPool::parallelFor(
        0, int64_t(values.size()), 256,
        [&](int64_t begin, int64_t end) {
          for (int64_t i = begin; i < end; ++i)
            values[i] += 1.0;
        },
        &history);
  for (pid_t child : others) {
    kill(child, SIGKILL);
    waitpid(child, nullptr, 0);
  }
  for (double value : values)
    ASSERT_EQ(value, rounds);
}

TEST(ThreadPool, EmptyRangeCallsNothing) {
  bool called = false;
  ThreadPool::parallelFor(3, 3, 1, [&](int64_t, int64_t) { called = true; });
  ThreadPool::parallelFor(4, 3, 1, [&](int64_t, int64_t) { called = true; });
  EXPECT_FALSE(called);
}

// A body that starts a loop of its own does not wait for the pool it is in.
TEST(ThreadPool, NestedLoopsFinish) {
  std::atomic<int64_t> sum{0};
  ThreadPool::parallelFor(0, 64, 1, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i)
      ThreadPool::parallelFor(
          0, 100, 1, [&](int64_t from, int64_t to) { sum += to - from; });
  });
  EXPECT_EQ(sum.load(), 6400);
}

TEST(ThreadPool, LoopsOfManyThreadsAreIndependent) {
  std::vector<std::thread> callers;
  std::atomic<int> wrong{0};
  for (int t = 0; t < 8; ++t)
    callers.emplace_back([&, t] {
      for (int round = 0; round < 200; ++round) {
        std::atomic<int64_t> sum{0};
        ThreadPool::parallelFor(0, 1000 + t, 16,
                                [&](int64_t begin, int64_t end) {
                                  int64_t part = 0;
                                  for (int64_t i = begin; i < end; ++i)
                                    part += i;
                                  sum += part;
                                });
        int64_t n = 1000 + t;
        wrong += sum.load() != n * (n - 1) / 2;
      }
    });
  for (std::thread &caller : callers)
    caller.join();
  EXPECT_EQ(wrong.load(), 0);
}

// Launches in quick succession meet workers that leave the one before.
TEST(ThreadPool, ManyShortLoops) {
  for (int round = 0; round < 20000; ++round) {
    std::atomic<int> count{0};
    ThreadPool::parallelFor(0, 8, 1, [&](int64_t begin, int64_t end) {
      count += static_cast<int>(end - begin);
    });
    ASSERT_EQ(count.load(), 8);
  }
}

TEST(ThreadPool, WakesParkedWorkers) {
  for (int round = 0; round < 20; ++round) {
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
    std::atomic<int> count{0};
    ThreadPool::parallelFor(0, 1000, 1, [&](int64_t begin, int64_t end) {
      count += static_cast<int>(end - begin);
    });
    ASSERT_EQ(count.load(), 1000);
  }
}

TEST(ThreadPool, RethrowsAndStaysUsable) {
  for (int round = 0; round < 50; ++round) {
    // Some range ends behind it, whatever the number of workers.
    auto fail = [](int64_t, int64_t end) {
      if (end > 5000)
        throw std::runtime_error("stop");
    };
    EXPECT_THROW(ThreadPool::parallelFor(0, 10000, 1, fail),
                 std::runtime_error);
    std::atomic<int64_t> count{0};
    ThreadPool::parallelFor(
        0, 10000, 1, [&](int64_t begin, int64_t end) { count += end - begin; });
    EXPECT_EQ(count.load(), 10000);
  }
}

// A forked child has none of the parent's threads and builds its own pool.
TEST(ThreadPool, WorksAfterFork) {
  ThreadPool::parallelFor(0, 1000, 1, [](int64_t, int64_t) {});
  pid_t child = fork();
  if (child == 0) {
    std::atomic<int64_t> count{0};
    ThreadPool::parallelFor(0, 100000, 1, [&](int64_t begin, int64_t end) {
      count += end - begin;
    });
    _exit(count.load() == 100000 ? 0 : 1);
  }
  int status = -1;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 0);
}

// The least quota of the process's group and its parents counts, in both
// versions of control groups.
TEST(PoolCpus, QuotaOfOwnControlGroup) {
  namespace fs = std::filesystem;
  fs::path root =
      fs::path(testing::TempDir()) / ("groups-" + std::to_string(getpid()));
  auto write = [&](const std::string &file, const std::string &text) {
    fs::create_directories((root / file).parent_path());
    std::ofstream(root / file) << text << "\n";
  };
  auto quota = [&](const std::string &groups) {
    write("self", groups);
    return warp::quotaOfControlGroups(root / "self", root);
  };
  EXPECT_EQ(quota("0::/a/b"), INT_MAX);
  write("a/b/cpu.max", "max 100000");
  EXPECT_EQ(quota("0::/a/b"), INT_MAX);
  write("a/cpu.max", "350000 100000");
  EXPECT_EQ(quota("0::/a/b"), 4);
  EXPECT_EQ(quota("0::/c"), INT_MAX);
  write("a/b/cpu.max", "150000 100000");
  EXPECT_EQ(quota("0::/a/b"), 2);
  write("cpu.max", "100000 100000");
  EXPECT_EQ(quota("0::/a/b"), 1);
  fs::remove(root / "cpu.max");
  write("cpu/jobs/cpu.cfs_quota_us", "-1");
  write("cpu/jobs/cpu.cfs_period_us", "100000");
  EXPECT_EQ(quota("3:cpuacct,cpu:/jobs/one"), INT_MAX);
  write("cpu/jobs/cpu.cfs_quota_us", "300000");
  EXPECT_EQ(quota("3:cpuacct,cpu:/jobs/one\n1:memory:/jobs"), 3);
  EXPECT_EQ(quota("3:cpuset:/jobs/one"), INT_MAX);
  fs::remove_all(root);
}

//===- Pool.h - Thread pool state -------------------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Workers wait for a job by watching one word, `epoch`: they spin for about
// 50 microseconds (a launch that follows another finds them awake), then park
// on a futex. A job is open while the pool's `state` lacks the Closed bit; the
// lower bits count the workers inside. The caller opens it, works, closes it
// when nothing is left to take and waits for the workers inside only, so one
// that is slow to wake never delays a launch: it finds the door closed.
//
// The range is cut into one stretch per thread. A thread takes chunks from its
// own stretch, then from the others'. Each stretch is one atomic counter on a
// cache line of its own. Chunks shrink towards the end of a stretch, so that
// the last ones end together.
//
// A job invites as many workers as WidthPolicy.h says; the others park.
//
// Workers are pinned, one per CPU. The caller is a thread of the user and is
// not; if it sits on a worker's CPU when a job begins, that worker moves to
// the CPU that was left free for the caller. Without this both may share one
// core for milliseconds.
//
// A worker can lose its core to another process, which then keeps it for
// milliseconds. If that worker has no chunk in hand, nobody waits for it: the
// others take its stretch. If it has one, the caller sees that its clock stands
// still, moves it to the caller's own CPU and sleeps until the chunk is done;
// after it the worker returns to where it belongs.
//
// After a fork the child has no workers. It forgets the parent's pool and
// builds its own at the first loop.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_POOL_H
#define WARP_LIB_RUNTIME_POOL_H

#include "WidthPolicy.h"
#include "warp/ThreadPool.h"

#include <atomic>
#include <chrono>
#include <cstdint>
#include <ctime>
#include <exception>
#include <mutex>
#include <sched.h>
#include <vector>

namespace warp {

/// Nanoseconds since some moment.
inline int64_t wallTime() {
  return std::chrono::steady_clock::now().time_since_epoch() /
         std::chrono::nanoseconds(1);
}

class Pool {
public:
  explicit Pool(const std::vector<int> &cpus);
  int size() const { return static_cast<int>(workers.size()); }
  /// Runs a loop by two or more threads.
  void run(int64_t begin, int64_t end, WidthPolicy::Plan plan,
           ThreadPool::Body body, void *context);

  /// Held by the thread whose loop runs. It guards all histories, too.
  std::mutex busy;

private:
  static constexpr uint32_t closed = 1u << 31;
  /// The caller sleeps until workers leave.
  static constexpr uint32_t watched = 1u << 30;

  struct alignas(64) Stretch {
    std::atomic<int64_t> next{0};
    int64_t end = 0;
  };

  /// Entry 0 stands for the caller.
  struct alignas(64) Worker {
    std::atomic<pid_t> thread{0};
    /// Index of its stretch in the job, 0 for none.
    std::atomic<int> invited{0};
    std::atomic<bool> parked{false};
    /// Its CPU; entry 0 has the one that is free for the caller.
    std::atomic<int> cpu{-1};
    clockid_t clock{};
    /// The clock at the last look of a caller that waits.
    int64_t lookedAt = 0;
    int64_t coreAtLook = 0;
    /// Written at every job: on a line that callers seldom read.
    alignas(64) std::atomic<bool> inside{false};
    std::atomic<bool> rescued{false};
  };

  void runWorker(int index);
  uint32_t waitForJob(int index, uint32_t seen);
  bool enter();
  void leave(Worker &self);
  void work(int index);
  bool runNextChunk(Stretch &stretch);
  void makeRoomForCaller();
  void invite();
  void cut(int64_t begin, int64_t end);
  void wakeInvited();
  void waitForWorkers();
  bool rescueLost(int64_t begin);
  bool hasLostCore(Worker &worker, int64_t begin);
  void sleepUntilDone(int64_t begin);
  void sendHome(const Worker &worker);

  alignas(64) std::atomic<uint32_t> epoch{0};
  alignas(64) std::atomic<uint32_t> state{closed};

  ThreadPool::Body body = nullptr;
  void *context = nullptr;
  int width = 1;
  int64_t leastChunk = 1;
  int64_t align = 1;
  std::atomic<bool> failed{false};
  std::exception_ptr failure;

  std::vector<Stretch> stretches;
  std::vector<Worker> workers;
  /// The CPUs of workers without one of their own.
  cpu_set_t everywhere{};
};

} // namespace warp

#endif // WARP_LIB_RUNTIME_POOL_H

//===- ThreadPool.h - Parallel loops on the CPU -----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Persistent worker threads, one per CPU that the process may use, the caller
// included. A loop gives every thread its own stretch of the range, taken in
// chunks; a thread that is done takes chunks of others. Equal ranges therefore
// meet the same caches launch after launch, and uneven work still spreads.
//
// A loop that comes again passes its history: the pool learns from it how many
// threads are worth waking and how small chunks may be.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_THREADPOOL_H
#define WARP_THREADPOOL_H

#include "warp/Export.h"

#include <cstdint>
#include <type_traits>

namespace warp {

class LoopHistory;

class WARP_API ThreadPool {
public:
  using Body = void (*)(void *context, int64_t begin, int64_t end);

  /// Threads that take part in a loop, the caller included. At most
  /// WARP_NUM_THREADS when that is set.
  static int size();

  /// CPUs that control groups of the process and their parents pay for; INT_MAX
  /// without a quota.
  static int quota();

  /// The number of the calling thread in the loop whose body it runs, below
  /// `size()` and different for threads that run the body at the same time; 0
  /// for a caller, and outside of loops.
  static int worker();

  /// Calls `body` on disjoint chunks of [begin, end) until all is done. `grain`
  /// items are worth handing to a thread; a history that has seen launches
  /// knows better. Chunks begin at multiples of 64 from `begin`, or of 16, or
  /// anywhere if there are few items that each take long. The first exception
  /// of a body is thrown again in the caller. A call from inside a body, or
  /// while another thread's loop runs, is done by the caller alone.
  static void parallelFor(int64_t begin, int64_t end, int64_t grain, Body body,
                          void *context, LoopHistory *history = nullptr);

  /// Calls a function on up to so many threads, the caller among them, at the
  /// same time or one after the other; the caller alone if others are at work.
  template <typename Fn> static void runTogether(int threads, Fn &&fn) {
    auto call = [](void *context, int64_t, int64_t) {
      (*static_cast<std::remove_reference_t<Fn> *>(context))();
    };
    runTogether(threads, static_cast<Body>(call),
                const_cast<void *>(static_cast<const void *>(&fn)));
  }
  static void runTogether(int threads, Body body, void *context);

  template <typename Fn>
  static void parallelFor(int64_t begin, int64_t end, int64_t grain, Fn &&fn,
                          LoopHistory *history = nullptr) {
    auto call = [](void *context, int64_t from, int64_t to) {
      (*static_cast<std::remove_reference_t<Fn> *>(context))(from, to);
    };
    parallelFor(begin, end, grain, call,
                const_cast<void *>(static_cast<const void *>(&fn)), history);
  }
};

} // namespace warp

#endif // WARP_THREADPOOL_H

//===- Forks.h - Fork-safe locks --------------------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A child process has the forking thread alone, so a lock that another thread
// held is taken for ever there. A fork therefore waits (for seconds at most)
// until no other thread is within a `ForkSection`, and those that come wait
// until the fork is over. A `ForkMutex` is held within one: no fork finds it
// taken by another thread, whatever other locks that holds.
//
// A lock that is held while kernels run is no such mutex: a fork would wait for
// them. The child makes those anew (`pthread_atfork`).
//
//===----------------------------------------------------------------------===//

#ifndef WARP_FORKS_H
#define WARP_FORKS_H

#include "warp/Export.h"

#include <mutex>

namespace warp {

/// May be nested.
class WARP_API ForkSection {
public:
  ForkSection() { enter(); }
  ~ForkSection() { leave(); }
  ForkSection(const ForkSection &) = delete;
  ForkSection &operator=(const ForkSection &) = delete;

  static void enter();
  static void leave();
};

/// A mutex that is free in a child process.
template <typename Mutex> class ForkLockable {
public:
  void lock() {
    ForkSection::enter();
    mutex.lock();
  }
  void unlock() {
    mutex.unlock();
    ForkSection::leave();
  }

private:
  Mutex mutex;
};

using ForkMutex = ForkLockable<std::mutex>;
using RecursiveForkMutex = ForkLockable<std::recursive_mutex>;

} // namespace warp

#endif // WARP_FORKS_H

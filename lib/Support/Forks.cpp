//===- Forks.cpp - Fork-safe locks ----------------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "warp/Forks.h"

#include <pthread.h>

#include <atomic>
#include <chrono>
#include <thread>

using namespace warp;
using std::chrono::steady_clock;

/// How long a fork waits: a thread within a section may itself wait for what
/// the forking thread has.
static constexpr std::chrono::seconds mostForkWait(5);

/// Threads within sections, forks in progress, and sections of this thread.
/// Numbers rather than a lock: a lock knows its thread by an id that a child
/// process does not have.
static std::atomic<int> threadsInside{0}, forks{0};
static thread_local int depth = 0;

static void waitBriefly() {
  std::this_thread::sleep_for(std::chrono::microseconds(50));
}

void ForkSection::enter() {
  // A fork waits for who is inside already, so that one must not wait for it.
  if (depth++ != 0)
    return;
  for (;;) {
    ++threadsInside;
    if (forks == 0)
      return;
    --threadsInside;
    waitBriefly();
  }
}

void ForkSection::leave() {
  if (--depth == 0)
    --threadsInside;
}

static void beforeFork() {
  int own = depth != 0;
  ++forks;
  // The other handlers of this fork may take locks.
  ++depth;
  auto end = steady_clock::now() + mostForkWait;
  while (threadsInside > own && steady_clock::now() < end)
    waitBriefly();
}

static void afterFork() {
  --depth;
  --forks;
}

static void afterForkInChild() {
  --depth;
  forks = 0;
  threadsInside = depth != 0;
}

[[maybe_unused]] static const int registered =
    pthread_atfork(beforeFork, afterFork, afterForkInChild);

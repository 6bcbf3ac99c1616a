//===- LaunchQueue.cpp - Operations queued behind compilation -------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "LaunchQueue.h"

#include "BackgroundThread.h"
#include "GraphTrace.h"
#include "warp/Device.h"
#include "warp/Error.h"
#include "warp/Forks.h"

#include <chrono>
#include <deque>
#include <new>
#include <pthread.h>
#include <vector>

using namespace warp;

std::atomic<int> warp::waitingOperations{0};
std::atomic<bool> warp::hasErrors{false};
thread_local int warp::behindNothing = 0;

/// Operations that wait, at most: a program that never synchronises does not
/// fill the memory of the host.
static constexpr int mostWaiting = 1 << 14;

/// Time between two looks at signals.
static constexpr std::chrono::milliseconds pollTime{100};

//===----------------------------------------------------------------------===//
// Tickets
//===----------------------------------------------------------------------===//

namespace {
/// Kernels since nothing was waiting, and how many have their code.
struct Progress {
  std::atomic<int> all{0}, done{0};
};
} // namespace
static Progress progress;

CodeTicket::CodeTicket() { ++progress.all; }

CodeTicket::~CodeTicket() {
  if (shared && !shared->isReady)
    finish(std::make_exception_ptr(
        Error(Error::Kind::Runtime, "the process ends")));
}

void CodeTicket::finish(std::exception_ptr error) {
  ++progress.done;
  std::lock_guard lock(shared->mutex);
  shared->error = std::move(error);
  shared->isReady.store(true, std::memory_order_release);
  shared->changed.notify_all();
}

//===----------------------------------------------------------------------===//
// The queue
//===----------------------------------------------------------------------===//

namespace {
struct Operation {
  std::function<void()> run = {};
  std::shared_ptr<CodeTicket::State> code = {};
  /// The kernel of a launch, to tell its errors.
  const void *kernel = nullptr;
  /// For a fill of contiguous memory: the memory, null for other operations,
  /// and the element.
  const char *filled = nullptr;
  size_t filledBytes = 0;
  std::vector<char> pattern = {};
  /// True for a free, which writes nothing that is in use.
  bool isFree = false;
};

struct KeptError {
  std::exception_ptr error;
  const void *kernel;
};

struct Queue {
  Queue();
  void add(Operation operation);
  bool findFill(const char *memory, char *value, size_t bytes);
  void drain(bool mayWait, bool mayThrow);
  /// The first operation; false if there is none. `missing` gets its code if
  /// that is not there yet.
  bool take(Operation &operation, std::shared_ptr<CodeTicket::State> &missing);
  void keep(KeptError error);
  void raise();

  ForkMutex mutex;
  std::deque<Operation> operations;
  std::vector<KeptError> errors;
  /// Held by the thread that does operations. No `ForkMutex`: it waits.
  std::mutex drainer;
  std::atomic<bool> isLazy{true}, isShared{false};
  WaitHooks hooks;

  static Queue &get() {
    static auto *queue = new Queue;
    return *queue;
  }
};

/// The caller's language lets other threads run meanwhile.
class Leave {
public:
  explicit Leave(const WaitHooks &hooks)
      : hooks(hooks), state(hooks.leave ? hooks.leave() : nullptr) {}
  ~Leave() {
    if (hooks.enter)
      hooks.enter(state);
  }

private:
  const WaitHooks &hooks;
  void *state;
};
} // namespace

Queue::Queue() {
  // GPUs are of no use in a child, and what others held is not freed there.
  pthread_atfork(nullptr, nullptr, [] {
    Queue &queue = get();
    new (&queue.operations) std::deque<Operation>;
    new (&queue.errors) std::vector<KeptError>;
    new (&queue.drainer) std::mutex;
    waitingOperations = 0;
  });
}

void Queue::add(Operation operation) {
  std::lock_guard lock(mutex);
  operations.push_back(std::move(operation));
  ++waitingOperations;
}

/// Copies what waiting fills will leave in memory; false if another operation
/// may write there, too. Operations that run already were added earlier than
/// those that wait.
bool Queue::findFill(const char *memory, char *value, size_t bytes) {
  std::lock_guard lock(mutex);
  for (auto last = operations.rbegin(); last != operations.rend(); ++last) {
    if (last->isFree)
      continue;
    const char *begin = last->filled, *end = begin + last->filledBytes;
    if (begin && (memory + bytes <= begin || end <= memory))
      continue;
    if (!begin || memory < begin || end < memory + bytes)
      return false;
    for (size_t i = 0; i < bytes; ++i)
      value[i] = last->pattern[(memory - begin + i) % last->pattern.size()];
    return true;
  }
  return false;
}

bool Queue::take(Operation &operation,
                 std::shared_ptr<CodeTicket::State> &missing) {
  std::lock_guard lock(mutex);
  if (operations.empty())
    return false;
  Operation &first = operations.front();
  if (first.code && !first.code->isReady.load(std::memory_order_acquire)) {
    missing = first.code;
    return true;
  }
  operation = std::move(first);
  operations.pop_front();
  return true;
}

void Queue::keep(KeptError error) {
  std::lock_guard lock(mutex);
  errors.push_back(std::move(error));
  hasErrors = true;
}

namespace {
/// Waits for code, and lets the caller's language look at signals.
class Wait {
public:
  Wait(const WaitHooks &hooks, bool mayThrow)
      : hooks(hooks), mayThrow(mayThrow) {}
  ~Wait() {
    if (polled && hooks.ended)
      hooks.ended();
  }
  void operator()(CodeTicket::State &code) {
    std::unique_lock lock(code.mutex);
    // A steady clock would need glibc 2.30.
    while (!code.changed.wait_until(lock,
                                    std::chrono::system_clock::now() + pollTime,
                                    [&] { return code.isReady.load(); })) {
      lock.unlock();
      if (hooks.poll) {
        polled = true;
        hooks.poll(progress.done, progress.all, mayThrow);
      }
      lock.lock();
    }
  }

private:
  const WaitHooks &hooks;
  bool mayThrow, polled = false;
};
} // namespace

void Queue::drain(bool mayWait, bool mayThrow) {
  std::unique_ptr<Leave> leave;
  if (mayWait)
    leave = std::make_unique<Leave>(hooks);
  std::unique_lock alone(drainer, std::defer_lock);
  if (mayWait)
    alone.lock();
  else if (!alone.try_lock())
    return;
  BehindNothing exempt;
  OutsideTraces notWithin;
  Wait wait(hooks, mayThrow);
  for (;;) {
    Operation operation;
    std::shared_ptr<CodeTicket::State> missing;
    if (!take(operation, missing))
      break;
    if (missing) {
      if (!mayWait)
        return;
      wait(*missing);
      continue;
    }
    try {
      if (operation.code && operation.code->error)
        std::rethrow_exception(operation.code->error);
      operation.run();
    } catch (...) {
      keep({std::current_exception(), operation.kernel});
    }
    // Before others know that it is done.
    operation = {};
    --waitingOperations;
  }
  progress.all = progress.done = 0;
}

void Queue::raise() {
  KeptError first;
  {
    std::lock_guard lock(mutex);
    if (errors.empty())
      return;
    first = errors.front();
    // Launches of one kernel fail alike.
    std::erase_if(errors, [&](const KeptError &error) {
      return error.error == first.error ||
             (first.kernel && error.kernel == first.kernel);
    });
    hasErrors = !errors.empty();
  }
  std::rethrow_exception(first.error);
}

//===----------------------------------------------------------------------===//
// Interface
//===----------------------------------------------------------------------===//

static void addOperation(Operation operation) {
  Queue &queue = Queue::get();
  queue.add(std::move(operation));
  queue.drain(/*mayWait=*/waitingOperations > mostWaiting, /*mayThrow=*/false);
}

bool warp::queueBehind(std::function<void()> operation) {
  if (!mustQueue())
    return false;
  addOperation({.run = std::move(operation)});
  return true;
}

void warp::queueLaunch(std::function<void()> operation,
                       std::shared_ptr<CodeTicket::State> code,
                       const void *kernel) {
  addOperation(
      {.run = std::move(operation), .code = std::move(code), .kernel = kernel});
}

bool warp::queueFree(std::function<void()> operation) {
  if (!mustQueue())
    return false;
  addOperation({.run = std::move(operation), .isFree = true});
  return true;
}

bool warp::queueFill(const void *memory, std::vector<char> pattern,
                     size_t count, std::function<void()> operation) {
  if (!mustQueue())
    return false;
  size_t bytes = pattern.size() * count;
  addOperation({.run = std::move(operation),
                .filled = static_cast<const char *>(memory),
                .filledBytes = bytes,
                .pattern = std::move(pattern)});
  return true;
}

bool warp::findQueuedFill(const void *memory, void *value, size_t bytes) {
  return mustQueue() && !hasErrors &&
         Queue::get().findFill(static_cast<const char *>(memory),
                               static_cast<char *>(value), bytes);
}

std::function<const Stream *()> warp::laterStream(int device,
                                                  const Stream *stream) {
  // A stream that goes drains the queue first.
  if (stream)
    return [stream] { return stream; };
  BehindNothing exempt;
  return [current = currentStream(device)] { return current.get(); };
}

void warp::waitForCode(
    const std::vector<std::shared_ptr<CodeTicket::State>> &list) {
  const WaitHooks &hooks = Queue::get().hooks;
  Leave leave(hooks);
  {
    Wait wait(hooks, /*mayThrow=*/true);
    for (const auto &code : list)
      wait(*code);
  }
  if (waitingOperations == 0)
    progress.all = progress.done = 0;
  for (const auto &code : list)
    if (code->error)
      std::rethrow_exception(code->error);
}

void warp::drainLaunches() {
  if (mustQueue())
    Queue::get().drain(/*mayWait=*/true, /*mayThrow=*/false);
}

void warp::drainReady() {
  if (mustQueue())
    Queue::get().drain(/*mayWait=*/false, /*mayThrow=*/false);
}

void warp::finishLaunches() {
  if (mustQueue())
    Queue::get().drain(/*mayWait=*/true, /*mayThrow=*/true);
  if (behindNothing == 0)
    raiseKept();
}

void warp::raiseKept() {
  if (hasErrors.load(std::memory_order_relaxed))
    Queue::get().raise();
}

void warp::setLazyCompile(bool isLazy) {
  Queue::get().isLazy = isLazy;
  if (!isLazy)
    drainLaunches();
}

bool warp::isLazyCompile() {
  Queue &queue = Queue::get();
  return queue.isLazy && !queue.isShared;
}

void warp::setCompileThreads(int count) { background::setUrgentThreads(count); }

void warp::shareWithOthers() {
  Queue::get().isShared = true;
  drainLaunches();
}

void warp::finishQueuedLaunches() { finishLaunches(); }
int warp::queuedOperations() { return waitingOperations; }

void warp::setWaitHooks(WaitHooks hooks) { Queue::get().hooks = hooks; }

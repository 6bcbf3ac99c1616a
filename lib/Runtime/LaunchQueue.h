//===- LaunchQueue.h - Operations queued behind compilation -----*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A launch on a GPU whose code is not there yet has it made by other threads
// and returns. It waits here, and so does what the program queues on GPUs after
// it: launches, copies, fills, sorts, builds of geometry, changes of handles,
// frees, events. There is one queue for all streams and devices, which keeps
// the order of the calls, and with it all that streams and events say about
// order. Its operations are done in turn by whoever needs an answer of the
// driver
// (`drainLaunches`, which every `ContextScope` begins with), and by launches
// that find the code of the first one there.
//
// So all that a launch uses is there when it runs: memory and handles go behind
// it, a stream that goes empties the queue, and the launch keeps its kernel.
// Allocations do not wait, since frees do: memory that is new is used by
// nothing in the queue.
//
// Public functions queue themselves as a whole, before they note anything in
// the trace of a capture: the trace gets them when they are done.
//
// An operation that fails is dropped, and its error kept until a call that may
// raise it (`finishLaunches`): a synchronisation, a read-back, a query, the end
// of a capture, the next launch.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_LAUNCHQUEUE_H
#define WARP_LIB_RUNTIME_LAUNCHQUEUE_H

#include "warp/Device.h"
#include "warp/LaunchQueue.h"

#include <atomic>
#include <condition_variable>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <vector>

namespace warp {

/// Code that another thread makes.
class CodeTicket {
public:
  CodeTicket();
  CodeTicket(CodeTicket &&) = default;
  /// Who drops it without an end tells those that wait.
  ~CodeTicket();

  /// Shared by the ticket, which the maker has, and those who wait.
  struct State {
    std::mutex mutex;
    std::condition_variable changed;
    std::atomic<bool> isReady{false};
    std::exception_ptr error;
  };

  void finish(std::exception_ptr error);
  const std::shared_ptr<State> &state() const { return shared; }

private:
  std::shared_ptr<State> shared = std::make_shared<State>();
};

/// Operations that wait or are being done.
extern std::atomic<int> waitingOperations;
/// Errors are kept.
extern std::atomic<bool> hasErrors;
extern thread_local int behindNothing;

/// While it lives, this thread does not wait for the queue: what it does needs
/// no order with operations there.
class BehindNothing {
public:
  BehindNothing() { ++behindNothing; }
  ~BehindNothing() { --behindNothing; }
  BehindNothing(const BehindNothing &) = delete;
  BehindNothing &operator=(const BehindNothing &) = delete;
};

/// Keeps a stream while an operation waits: the one given, or the current one.
std::function<const Stream *()> laterStream(int device, const Stream *stream);

/// True if what this thread queues on GPUs has to come behind the queue.
inline bool mustQueue() {
  return __builtin_expect(
             waitingOperations.load(std::memory_order_acquire) != 0, 0) &&
         behindNothing == 0;
}

/// Adds an operation if others wait; false if it is to be done now.
bool queueBehind(std::function<void()> operation);
/// The same for a call on a device's stream, null for the one that is current
/// now; it gets the stream.
template <typename Call>
bool queueCall(int device, const Stream *stream, Call &&call) {
  if (!mustQueue() || isHost(device))
    return false;
  return queueBehind([call = std::forward<Call>(call),
                      where = laterStream(device, stream)] { call(where()); });
}
/// Adds a fill of memory, whose value `findQueuedFill` knows from then on.
bool queueFill(const void *memory, std::vector<char> pattern, size_t count,
               std::function<void()> operation);
/// Adds a free, which changes no memory that is in use.
bool queueFree(std::function<void()> operation);
/// Bytes of the host that the queue copies for an operation, at most.
inline constexpr size_t mostStaged = size_t(1) << 20;
/// Adds a launch of a kernel, which cannot be done before the code is there, if
/// there is any.
void queueLaunch(std::function<void()> operation,
                 std::shared_ptr<CodeTicket::State> code, const void *kernel);
/// Waits for code, then throws the first error.
void waitForCode(const std::vector<std::shared_ptr<CodeTicket::State>> &list);

/// Does all operations, and waits for their code. Never throws.
void drainLaunches();
/// Does the operations whose code is there.
void drainReady();
/// Throws the first error that was kept.
void raiseKept();
/// Does all operations, for callers that may raise: throws the first error that
/// was kept, or what an interrupt throws, with the rest of the queue left as it
/// is.
void finishLaunches();

} // namespace warp

#endif // WARP_LIB_RUNTIME_LAUNCHQUEUE_H

//===- LaunchQueue.h - Launches that wait for their code --------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LAUNCHQUEUE_H
#define WARP_LAUNCHQUEUE_H

#include "warp/Export.h"

#include <cstddef>
#include <string>

namespace warp {

/// Lets launches on GPUs return before their code is there, which they do at
/// first (`Kernel::queue`).
WARP_API void setLazyCompile(bool isLazy);
WARP_API bool isLazyCompile();
/// Threads that make code for such launches; 0 is one per processor.
WARP_API void setCompileThreads(int count);
/// The program `ptxas` that assembles code for such launches beside the driver:
/// a file, "" for none, or "auto", which looks where CUDA toolkits are.
WARP_API void setAssembler(std::string file);
/// Does what waits, and lets nothing wait from now on: other libraries use
/// memory or streams, and know nothing of what waits here.
WARP_API void shareWithOthers();
/// Waits for launches that wait, and throws the first error of those that
/// failed.
WARP_API void finishQueuedLaunches();
/// Operations that wait on the host.
WARP_API int queuedOperations();

/// Copies out what fills that wait will leave in memory of a GPU. False if
/// nothing waits, or if something else that waits may change the memory.
WARP_API bool findQueuedFill(const void *memory, void *value, size_t bytes);

/// Functions of the caller's language for threads that wait for code.
struct WaitHooks {
  /// Called before a thread waits, and afterwards with what that gave.
  void *(*leave)() = nullptr;
  void (*enter)(void *state) = nullptr;
  /// Called ten times a second; `done` of `all` kernels have their code. With
  /// `mayThrow` it may throw to end the wait.
  void (*poll)(int done, int all, bool mayThrow) = nullptr;
  /// Called when the wait is over, if `poll` was.
  void (*ended)() = nullptr;
};
WARP_API void setWaitHooks(WaitHooks hooks);

} // namespace warp

#endif // WARP_LAUNCHQUEUE_H

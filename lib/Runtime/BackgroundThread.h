//===- BackgroundThread.h - Background compilation threads ------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Two groups of threads, each started by its first task, do tasks in order. One
// is of low priority, for work that nobody waits for. A fork waits for the
// tasks in progress, since a child process would never get the locks that they
// hold, and the child goes on with those that wait. The exit of the process
// waits, too, but a compilation in progress is given up (Compiler/Abandon.h),
// and the rest is dropped: what a task uses may be gone later.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_BACKGROUNDTHREAD_H
#define WARP_LIB_RUNTIME_BACKGROUNDTHREAD_H

#include <functional>

namespace warp::background {

/// A task must not throw. Dropped once the process has begun to exit.
void add(std::function<void()> task);
/// A task that somebody waits for, on as many threads as there are processors.
/// The exit of the process may do it instead of dropping it.
void addUrgent(std::function<void()> task, bool alsoAtExit = false);
/// Such tasks that wait or are being done.
int urgentTasks();
/// True on a thread of either group.
bool isWorker();
/// Threads for urgent tasks; 0 is one per processor. Changes later ones only.
void setUrgentThreads(int count);

} // namespace warp::background

#endif // WARP_LIB_RUNTIME_BACKGROUNDTHREAD_H

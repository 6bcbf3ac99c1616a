//===- BackgroundThread.h - Work that nobody waits for ----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// One thread of low priority, started by the first task, does tasks one after
// another. A fork waits for the task in progress, since a child process would
// never get the locks that it holds, and the child goes on with those that
// wait. The exit of the process waits, too, but a compilation in progress is
// given up (Compiler/Abandon.h), and the rest is dropped: what a task uses may
// be gone later.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_BACKGROUNDTHREAD_H
#define WARP_LIB_RUNTIME_BACKGROUNDTHREAD_H

#include <functional>

namespace warp::background {

/// A task must not throw. Dropped once the process has begun to exit.
void add(std::function<void()> task);

} // namespace warp::background

#endif // WARP_LIB_RUNTIME_BACKGROUNDTHREAD_H

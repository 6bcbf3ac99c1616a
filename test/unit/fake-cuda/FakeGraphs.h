//===- FakeGraphs.h - Graphs of the fake driver -----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TEST_FAKE_CUDA_FAKEGRAPHS_H
#define WARP_TEST_FAKE_CUDA_FAKEGRAPHS_H

#include <cstdint>
#include <functional>

/// Records a call if its stream is captured; it is repeated when the graph
/// runs. `function`: that of a kernel.
bool fakeRecord(void *stream, std::function<int()> call,
                void *function = nullptr, bool isProgrammatic = false);
/// True if a stream is captured.
bool fakeIsCapturing(void *stream);
/// A capture that something forbidden was done to ends in an error.
void fakeInvalidateCaptures();
/// Lets a stream join the capture that an event was recorded in.
void fakeRecordEvent(void *event, void *stream);
void fakeWaitEvent(void *stream, void *event);
/// The effect of the kernel that sets conditions.
int fakeSetCondition(uint64_t handle, const int *value, bool negated);
/// Records a launch of it, if its stream is captured.
bool fakeRecordCondition(void *stream, uint64_t handle, const int *value,
                         unsigned negated);
/// That kernel, once it was launched.
extern void *fakeSetter;

/// Puts a call into a graph instead if its stream is captured.
#define RECORDED(stream, call)                                                 \
  if (fakeRecord(stream, [=] { return call; }))                                \
    return success;

#endif // WARP_TEST_FAKE_CUDA_FAKEGRAPHS_H

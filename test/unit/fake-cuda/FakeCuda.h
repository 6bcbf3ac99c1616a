//===- FakeCuda.h - Shared parts of the fake driver -------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TEST_FAKE_CUDA_FAKECUDA_H
#define WARP_TEST_FAKE_CUDA_FAKECUDA_H

#include <mutex>

#define EXPORT extern "C" __attribute__((visibility("default")))

namespace fake {

inline constexpr int success = 0, invalidValue = 1, outOfMemory = 2;
inline constexpr int notFound = 500, notReady = 600, illegalAddress = 700;

/// Guards all state.
extern std::mutex mutex;
extern thread_local void *current;
/// Returned by everything that touches the device, once set: a fault.
extern int fault;

/// Writes a call down with the number of its stream; returns the fault.
int note(const char *call, void *stream);
/// Writes down that work was queued, for `fakeCudaTakeOrder`.
void noteOrder(const char *work);

} // namespace fake

#endif // WARP_TEST_FAKE_CUDA_FAKECUDA_H

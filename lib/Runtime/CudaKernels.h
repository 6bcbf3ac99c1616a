//===- CudaKernels.h - Kernels of the library itself ------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Those of lib/DeviceLib/cuda, which Clang has made PTX when the library was
// built.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_CUDAKERNELS_H
#define WARP_LIB_RUNTIME_CUDAKERNELS_H

#include "DeviceState.h"
#include "warp/Sequences.h"

#include <string>

namespace warp {

inline int64_t ceilDivide(int64_t a, int64_t b) { return (a + b - 1) / b; }

/// A kernel of a file by its name; the file is loaded once per device, never
/// unloaded.
cuda::Function kernelOf(int device, const char *code, const std::string &name);

/// Queues a kernel for blocks of `threads`; `Args` are its parameters.
template <typename... Args>
void launchKernel(const QueuedWork &work, cuda::Function function,
                  int64_t blocks, int64_t rows, int threads, Args... args) {
  void *arguments[] = {&args...};
  WARP_CUDA(launchKernel, function, blocks, rows, 1, threads, 1, 1, 0,
            work.stream(), arguments, nullptr);
}

/// The words that a sort works with, zero at first: counts of each pass and
/// digit, the next tile of each pass, and what each tile publishes.
class SortState {
public:
  SortState(const Pairs &pairs, int beginBit, int endBit);

  int64_t words() const;
  /// Sorts once the digits are counted. Returns whether the result is in the
  /// room behind the pairs.
  bool move(const QueuedWork &work, int device, uint32_t *state) const;

private:
  Pairs pairs;
  int beginBit, endBit, passes;
  int64_t counts, tiles;
};

} // namespace warp

#endif // WARP_LIB_RUNTIME_CUDAKERNELS_H

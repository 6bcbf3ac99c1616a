//===- LibraryKernels.h - Precompiled runtime kernels -----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The kernels of lib/DeviceLib/cuda, which Clang has made PTX when the library
// was built.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_CUDA_LIBRARYKERNELS_H
#define WARP_LIB_RUNTIME_CUDA_LIBRARYKERNELS_H

#include "Code.h"
#include "Device.h"
#include "Support.h"
#include "warp/Sequences.h"

#include <string>

namespace warp {

struct LibraryKernel {
  cuda::Function function = nullptr;
  /// True if it waits for the one before it on its stream.
  bool waits = false;
};

/// A kernel of a file, "Sort", by its name; loaded once per device, alone if
/// the driver has to assemble it, and never unloaded.
LibraryKernel kernelOf(int device, const char *file, const std::string &name);

/// Queues a kernel for blocks of `threads`; `Args` are its parameters.
template <typename... Args>
void launchKernel(const QueuedWork &work, const LibraryKernel &kernel,
                  int64_t blocks, int64_t rows, int threads, Args... args) {
  void *arguments[] = {&args...};
  cuda::LaunchConfig config{{unsigned(blocks), unsigned(rows), 1},
                            {unsigned(threads), 1, 1},
                            0,
                            work.stream()};
  cuda::check(queueKernel(kernel.function, config, arguments, kernel.waits),
              "launchKernel");
}

/// The words that a sort works with, zero at first: counts of each pass and
/// digit, the next tile of each pass, and the status words of the decoupled
/// look-back, one for each tile and digit.
class SortState {
public:
  SortState(int device, const Pairs &pairs, int beginBit, int endBit);

  int64_t words() const;
  /// Sorts once the digits are counted. Returns whether the result is in the
  /// room behind the pairs.
  bool move(const QueuedWork &work, uint32_t *state) const;

private:
  int device;
  Pairs pairs;
  int beginBit, endBit, passes;
  int64_t counts, tiles;
  bool isShort = false;
};

} // namespace warp

#endif // WARP_LIB_RUNTIME_CUDA_LIBRARYKERNELS_H

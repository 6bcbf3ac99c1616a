//===- ExactSums.h - Launches with exact sums -------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_EXACTSUMS_H
#define WARP_LIB_RUNTIME_EXACTSUMS_H

#include "warp/Kernel.h"
#include "warp/Memory.h"

#include <memory>
#include <string>
#include <vector>

namespace warp {

/// True if arrays that a launch sums into share memory with others that it
/// accesses.
bool overlap(const std::vector<SummedArray> &arrays, const void *params);

/// The sums of one launch.
class ExactSums {
public:
  /// Gets memory for them, on a CUDA device with work on the stream.
  ExactSums(const std::string &kernel, int device,
            const std::vector<SummedArray> &arrays, const void *params,
            size_t paramSize, const Stream *stream);

  /// The parameters, with descriptors of the sums.
  void *params() { return block.data(); }
  /// Adds the sums to the elements of the arrays.
  void finish();

private:
  /// Pages of the system, which are zero when they are first touched.
  struct Pages {
    void *memory = nullptr;
    size_t bytes = 0;
    ~Pages();
  };

  void *allocate(size_t bytes);

  int device;
  const Stream *stream;
  std::vector<uint64_t> block;
  struct Sum {
    int width;
    SumDescriptor descriptor;
  };
  std::vector<Sum> sums;
  Pages pages;
  std::vector<int64_t> fewWords;
  std::unique_ptr<Buffer> deviceMemory;
};

/// The kernel (out, digits, touched) that adds sums to floats of that width.
Kernel &roundingKernel(int width);

} // namespace warp

#endif // WARP_LIB_RUNTIME_EXACTSUMS_H

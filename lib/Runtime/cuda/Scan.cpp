//===- Scan.cpp - Prefix sums on CUDA -------------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A launch of lib/DeviceLib/cuda/Scan.cpp.
//
//===----------------------------------------------------------------------===//

#include "DeviceLib/cuda/LaunchShapes.h"
#include "LibraryKernels.h"

#include <string>

using namespace warp;
using namespace scanShape;

static const char *sumName(NumberType kind) {
  switch (kind) {
  case NumberType::Int32:
  case NumberType::UInt32:
    return "u32";
  case NumberType::Float32:
    return "f32";
  case NumberType::Int64:
  case NumberType::UInt64:
    return "u64";
  case NumberType::Float64:
    return "f64";
  }
  return nullptr;
}

void CudaDevice::scan(NumberType kind, int width, Sequence out, Sequence in,
                      int64_t count, bool inclusive, const Stream *stream) {
  // Status words of the decoupled look-back, each with 32 bits of the sum of a
  // tile or of a group of tiles.
  int64_t tile = threads * int64_t(threadBytes / sizeOf(kind));
  int64_t tiles = ceilDivide(count, tile);
  int64_t sums = tiles + ceilDivide(tiles, threads);
  int64_t words = tiles > 1 ? sums * width * (sizeOf(kind) / 4) : 0;
  Buffer state(index, words * 8, false, stream);
  if (words)
    setMemory(state.data(), index, 0, state.size(), stream);
  QueuedWork work(index, stream);
  launchKernel(
      work, kernelOf(index, "Scan", std::string("scan_") + sumName(kind)),
      tiles * width, 1, threads, in.data, in.stride, out.data, out.stride,
      count, width, int(tiles), state.data(), int(inclusive));
}

//===- Fill.cpp - Fills of several regions by one CUDA kernel -------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The table of regions is the kernel's argument. A block has a run of 16 KiB of
// one region, and a thread writes 16 bytes at a time, or the bytes of them that
// belong to the region.
//
//===----------------------------------------------------------------------===//

#include "../gpu/Gpu.h"
#include "LaunchShapes.h"

using namespace gpu;
using namespace fillShape;

namespace {
struct Region {
  uint64_t begin, end;
  /// The bytes at an address that 16 divides.
  uint64_t pattern[2];
};
struct Table {
  Region regions[mostRegions];
  /// The number of the first block of each region.
  int32_t firsts[mostRegions];
  int32_t count;
};
struct alignas(16) Words {
  uint64_t low, high;
};
} // namespace

/// Writes those of 16 bytes that lie in a region.
static void putPart(const Region &region, uint64_t at) {
#pragma nounroll
  for (int i = 0; i < 16; ++i) {
    uint64_t word = i < 8 ? region.pattern[0] : region.pattern[1];
    if (at + i >= region.begin && at + i < region.end)
      *reinterpret_cast<unsigned char *>(at + i) =
          static_cast<unsigned char>(word >> i % 8 * 8);
  }
}

WARP_KERNEL(threads, 4) void fill_regions(Table table) {
  int index = 0;
  while (index + 1 < table.count && table.firsts[index + 1] <= block())
    ++index;
  const Region region = table.regions[index];
  uint64_t run = block() - table.firsts[index];
  uint64_t first =
      (region.begin & ~uint64_t(15)) + (run * rounds * threads + thread()) * 16;
#pragma unroll
  for (int i = 0; i < rounds; ++i) {
    uint64_t at = first + uint64_t(i) * threads * 16;
    if (at >= region.begin && at + 16 <= region.end)
      *reinterpret_cast<Words *>(at) = {region.pattern[0], region.pattern[1]};
    else if (at < region.end)
      putPart(region, at);
  }
}

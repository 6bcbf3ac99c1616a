//===- CopyNest.h - Canonical form of strided copies ------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_COPYNEST_H
#define WARP_LIB_RUNTIME_COPYNEST_H

#include "warp/Launch.h"

#include <cstdint>

namespace warp {

/// Dimensions around runs of bytes that are packed on both sides.
struct CopyNest {
  struct Dimension {
    int64_t extent, dstStride, srcStride;
  };

  char *dst;
  const char *src;
  int64_t run;
  int rank = 0;
  Dimension dims[maxRank];
};

/// The simplest form of a copy between views of one shape.
CopyNest simplifyCopy(const ArrayDescriptor &dst, const ArrayDescriptor &src,
                      int64_t elementSize);
int64_t countElements(const ArrayDescriptor &array);
/// The same shape, packed, in other memory.
ArrayDescriptor packedLike(const ArrayDescriptor &array, size_t elementSize,
                           void *data);

/// Shortest prefix, of 1, 2, 4 bytes or the whole, whose repetition is the
/// pattern.
size_t shortestPeriod(const char *pattern, size_t size);

} // namespace warp

#endif // WARP_LIB_RUNTIME_COPYNEST_H

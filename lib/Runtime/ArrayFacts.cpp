//===- ArrayFacts.cpp - Array facts: found once, read by launches ---------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "CopyNest.h"
#include "warp/Memory.h"

#include <climits>

using namespace warp;

/// Bytes between rows of which few elements are in a cache at once: a set of
/// 8 lines of 64 bytes is for every 2 or 4 KiB.
static constexpr int32_t setStride = 2048;

int64_t warp::countElements(const ArrayDescriptor &array) {
  int64_t count = 1;
  for (int i = 0; i < array.ndim; ++i)
    count *= array.shape[i];
  return count;
}

bool warp::isContiguous(const ArrayDescriptor &array, size_t elementSize) {
  int64_t expected = static_cast<int64_t>(elementSize);
  for (int i = array.ndim - 1; i >= 0; --i) {
    if (array.shape[i] != 1 && array.strides[i] != expected)
      return countElements(array) == 0;
    expected *= array.shape[i];
  }
  return true;
}

static bool hasFarRows(const ArrayDescriptor &array) {
  for (int d = 0; d + 1 < array.ndim; ++d)
    if (array.strides[d] != 0 && array.strides[d] % setStride == 0 &&
        array.shape[d] > 1)
      return true;
  return false;
}

int32_t warp::arrayFacts(const ArrayDescriptor &array, size_t elementSize) {
  auto size = static_cast<int64_t>(elementSize);
  int32_t facts = arrayKnown;
  int64_t count = countElements(array);
  if (isContiguous(array, elementSize)) {
    facts |= arrayPacked;
    int64_t span = array.ndim ? int64_t(array.shape[0]) * array.strides[0] : 0;
    if (array.data && count <= INT32_MAX && span == count * size)
      facts |= arraySpan;
  }
  auto addresses = reinterpret_cast<uintptr_t>(array.data) |
                   reinterpret_cast<uintptr_t>(array.grad);
  if (addresses % packedAlignment(size) == 0)
    facts |= arrayAligned;
  if (hasFarRows(array))
    facts |= arrayFarRows;
  if (count > INT32_MAX)
    facts |= arrayLong;
  return facts;
}

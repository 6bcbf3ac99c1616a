//===- Overlap.cpp - Memory of a launch's arrays --------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Asked at every launch, so overlaps are found by ranges of addresses: two
// columns of one matrix count as overlapping.
//
//===----------------------------------------------------------------------===//

#include "Overlap.h"

#include <cstring>

using namespace warp;

/// Ranges that are compared pair by pair; more are not worth the time.
static constexpr int mostRanges = 48;

AddressRange warp::rangeOf(const void *data, const ArrayDescriptor &array,
                           int64_t elementSize, int64_t strideScale) {
  if (!data)
    return {};
  auto start = reinterpret_cast<uint64_t>(data);
  AddressRange range{start, start + elementSize};
  for (int i = 0; i < array.ndim; ++i) {
    int64_t extent = array.shape[i];
    if (extent <= 0)
      return {};
    int64_t span = (extent - 1) * array.strides[i] * strideScale;
    (span < 0 ? range.begin : range.end) += span;
  }
  return range;
}

std::optional<AddressRange> warp::possibleRangeOf(const void *data,
                                                  const ArrayDescriptor &array,
                                                  int64_t elementSize,
                                                  int64_t strideScale) {
  constexpr __int128 most = __int128(1) << 62;
  if (array.ndim < 0 || array.ndim > maxRank || elementSize < 0 ||
      elementSize > most || strideScale < 0 || strideScale > INT32_MAX)
    return {};
  __int128 bytes = elementSize, count = 1;
  auto begin = __int128(reinterpret_cast<uint64_t>(data)), end = begin + bytes;
  for (int i = 0; i < array.ndim; ++i) {
    if (array.shape[i] < 0)
      return {};
    bytes *= array.shape[i];
    count *= array.shape[i];
    __int128 span =
        __int128(array.shape[i] - 1) * array.strides[i] * strideScale;
    (span < 0 ? begin : end) += span;
    if (bytes > most || count > most)
      return {};
  }
  if (count == 0 || !data)
    return AddressRange{};
  if (begin < 0 || end > most)
    return {};
  return AddressRange{uint64_t(begin), uint64_t(end)};
}

bool warp::areDisjoint(const std::vector<Access> &accesses,
                       const void *params) {
  AddressRange written[mostRanges], all[mostRanges];
  int writtenCount = 0, count = 0;
  for (const Access &access : accesses) {
    if (count + 2 > mostRanges)
      return false;
    ArrayDescriptor array;
    std::memcpy(&array, static_cast<const char *>(params) + access.offset,
                sizeof(array));
    bool isWritten = access.stored || access.combined;
    auto add = [&](AddressRange range) {
      for (int i = 0; i < (isWritten ? count : writtenCount); ++i)
        if (range.overlaps((isWritten ? all : written)[i]))
          return false;
      all[count++] = range;
      if (isWritten)
        written[writtenCount++] = range;
      return true;
    };
    if (!add(rangeOf(array.data, array, access.elementSize, 1)) ||
        (access.gradientSize &&
         !add(rangeOf(array.grad, array, access.gradientSize,
                      access.gradientSize / access.elementSize))))
      return false;
  }
  return true;
}

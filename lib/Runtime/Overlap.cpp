//===- Overlap.cpp - Alias checks of launch arguments ---------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Asked at every launch, so overlaps are found by ranges of addresses: two
// columns of one matrix count as overlapping. A packed array has its range as a
// fact; that of another follows from its extents and strides.
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

static AddressRange dataRange(const Access &access,
                              const ArrayDescriptor &array) {
  if (!(array.flags & arraySpan))
    return rangeOf(array.data, array, access.elementSize, 1);
  auto start = reinterpret_cast<uint64_t>(array.data);
  return {start, start + int64_t(array.shape[0]) * array.strides[0]};
}

static AddressRange gradientRange(const Access &access,
                                  const ArrayDescriptor &array) {
  if (!array.grad)
    return {};
  int64_t scale = access.gradientSize == access.elementSize
                      ? 1
                      : access.gradientSize / access.elementSize;
  if (!(array.flags & arraySpan))
    return rangeOf(array.grad, array, access.gradientSize, scale);
  auto start = reinterpret_cast<uint64_t>(array.grad);
  return {start, start + int64_t(array.shape[0]) * array.strides[0] * scale};
}

bool warp::areDisjoint(const std::vector<Access> &accesses,
                       const void *params) {
  AddressRange written[mostRanges], all[mostRanges];
  int writtenCount = 0, count = 0;
  for (const Access &access : accesses) {
    if (count + 2 > mostRanges)
      return false;
    const auto &array = *reinterpret_cast<const ArrayDescriptor *>(
        static_cast<const char *>(params) + access.offset);
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
    if (!add(dataRange(access, array)) ||
        (access.gradientSize && !add(gradientRange(access, array))))
      return false;
  }
  return true;
}

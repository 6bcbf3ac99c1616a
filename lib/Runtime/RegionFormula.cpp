//===- RegionFormula.cpp - Evaluation of access region formulas -----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Asked at each launch that a tape records, so nothing is allocated but what
// is returned. Indices become progressions, accesses boxes of those (see
// RegionBoxes.h), and strides make blocks of memory of them.
//
//===----------------------------------------------------------------------===//

#include "RegionBoxes.h"
#include "RegionValues.h"

#include "warp/Compile.h"
#include "warp/Kernel.h"
#include "warp/Regions.h"

#include <algorithm>
#include <cstring>
#include <numeric>
#include <optional>

using namespace warp;

//===----------------------------------------------------------------------===//
// Indices
//===----------------------------------------------------------------------===//

/// The values of an index, none if no thread has one; the whole dimension if
/// they are not known.
static std::optional<Span> spanOf(const RegionFormula::Index &index,
                                  const RegionValues &values, int64_t extent) {
  Span whole{0, extent - 1, 1};
  if (index.base < 0)
    return whole;
  Span span{values[index.base], values[index.base], 0};
  for (const RegionFormula::Symbol &symbol : index.symbols) {
    int64_t count = values[symbol.count], reach;
    if (count <= 0)
      return std::nullopt;
    if (__builtin_mul_overflow(values[symbol.factor], count - 1, &reach))
      return whole;
    int64_t &end = reach < 0 ? span.start : span.last;
    if (__builtin_add_overflow(end, reach, &end))
      return whole;
    if (reach)
      span.step = std::gcd(span.step, std::abs(values[symbol.factor]));
  }
  span.step = std::max<int64_t>(span.step, 1);
  return span;
}

/// Cuts off what is outside of [0, extent); false if nothing is left.
static bool clip(Span &span, int64_t extent) {
  if (span.start < 0)
    span.start += (-span.start + span.step - 1) / span.step * span.step;
  if (span.last >= extent && span.start < extent)
    span.last = span.start + (extent - 1 - span.start) / span.step * span.step;
  return span.start <= span.last && span.start < extent;
}

/// The elements that an index may stand for: those from the beginning and those
/// that are counted from the end.
static int placesOf(const RegionFormula::Index &index,
                    const RegionValues &values, int64_t extent, Span *places) {
  std::optional<Span> span = spanOf(index, values, extent);
  if (!span)
    return 0;
  int count = 0;
  Span plain = *span;
  if (clip(plain, extent))
    places[count++] = plain;
  if (span->start < 0 && index.mayWrap) {
    Span wrapped = *span;
    if (wrapped.last >= 0)
      wrapped.last =
          wrapped.start + (-1 - wrapped.start) / wrapped.step * wrapped.step;
    wrapped.start += extent;
    wrapped.last += extent;
    if (clip(wrapped, extent))
      places[count++] = wrapped;
  }
  return count;
}

//===----------------------------------------------------------------------===//
// Boxes
//===----------------------------------------------------------------------===//

static void addBoxes(const RegionFormula::Access &access,
                     const RegionValues &values, const ArrayDescriptor &array,
                     Boxes &boxes) {
  Span places[maxRank][2];
  int counts[maxRank];
  int total = 1;
  for (int i = 0; i < array.ndim; ++i) {
    static const RegionFormula::Index any;
    const auto &index =
        size_t(i) < access.indices.size() ? access.indices[i] : any;
    counts[i] = placesOf(index, values, array.shape[i], places[i]);
    total *= counts[i];
  }
  for (int number = 0; number < total; ++number) {
    Box box;
    for (int i = 0, rest = number; i < array.ndim; ++i) {
      box.dims[i] = places[i][rest % counts[i]];
      rest /= counts[i];
    }
    boxes.add(box);
  }
}

static MemoryBlock blockOf(const Box &box, ArrayDescriptor array,
                           int64_t itemSize) {
  auto *data = static_cast<char *>(array.data);
  int64_t steps[maxRank];
  for (int i = 0; i < array.ndim; ++i) {
    const Span &span = box.dims[i];
    steps[i] = span.step;
    array.shape[i] =
        static_cast<int32_t>((span.last - span.start) / span.step + 1);
    data += span.start * array.strides[i];
    if (array.strides[i] < 0)
      data += (span.last - span.start) * array.strides[i];
  }
  MemoryBlock block;
  block.start = reinterpret_cast<uint64_t>(data);
  block.item = itemSize;
  // Insertion by stride.
  for (int i = 0; i < array.ndim; ++i) {
    int64_t stride = std::abs(int64_t(array.strides[i]));
    if (array.shape[i] < 2 || !stride)
      continue;
    int place = block.rank++;
    for (; place > 0 && block.dims[place - 1].stride < stride; --place)
      block.dims[place] = block.dims[place - 1];
    block.dims[place] = {stride, steps[i], array.shape[i]};
  }
  return block;
}

//===----------------------------------------------------------------------===//
// Launches
//===----------------------------------------------------------------------===//

/// The accesses of a kernel to one array, as a region.
static Region regionOf(const RegionFormula &formula, const RegionValues &values,
                       int32_t number, const ArrayDescriptor &array,
                       int64_t itemSize, bool written) {
  Boxes boxes(array.ndim);
  for (const RegionFormula::Access &access : formula.accesses)
    if (access.array == number && (written ? access.writes : access.reads))
      addBoxes(access, values, array, boxes);
  Region region;
  region.blocks.reserve(boxes.size());
  for (int i = 0; i < boxes.size(); ++i)
    region.blocks.push_back(blockOf(boxes[i], array, itemSize));
  return region;
}

void warp::findRegions(const RegionFormula &formula,
                       const std::vector<Access> &accesses,
                       const LaunchDim &dim, const void *params,
                       std::vector<ArrayRegions> &regions) {
  RegionValues values(formula, dim, params);
  regions.resize(accesses.size());
  for (size_t i = 0; i < accesses.size(); ++i) {
    const Access &access = accesses[i];
    ArrayDescriptor array;
    std::memcpy(&array, static_cast<const char *>(params) + access.offset,
                sizeof(array));
    auto *extents = array.shape;
    if (!array.data || std::count(extents, extents + array.ndim, 0))
      continue;
    auto number = static_cast<int32_t>(i);
    bool reads = access.loaded || access.fetched;
    bool writes = access.stored || access.combined;
    if (i >= formula.unknown.size() || formula.unknown[i]) {
      MemoryBlock whole = blockOf(array, access.elementSize);
      if (reads)
        regions[i].read.blocks.push_back(whole);
      if (writes)
        regions[i].written.blocks.push_back(whole);
      continue;
    }
    if (reads)
      regions[i].read =
          regionOf(formula, values, number, array, access.elementSize, false);
    if (writes)
      regions[i].written =
          regionOf(formula, values, number, array, access.elementSize, true);
  }
}

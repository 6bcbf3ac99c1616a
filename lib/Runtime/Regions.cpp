//===- Regions.cpp - Overlap tests of strided memory blocks ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Two blocks are compared digit by digit: the distance from the lower one is
// written as a sum of multiples of all strides, the largest first, like a
// number in a mixed radix. Where no digit runs into the next larger stride,
// elements are the same if all digits are, and those of one dimension are
// arithmetic progressions.
//
//===----------------------------------------------------------------------===//

#include "warp/Regions.h"

#include <algorithm>
#include <limits>
#include <numeric>

using namespace warp;

//===----------------------------------------------------------------------===//
// Progressions
//===----------------------------------------------------------------------===//

namespace {

/// low, low + step, ..., `count` numbers.
struct Progression {
  int64_t low = 0, step = 1, count = 1;
  int64_t last() const { return low + step * (count - 1); }
};

/// Digits of a block along strides, then those of the bytes of an element.
struct Digits {
  Progression at[2 * maxRank + 1];
};

} // namespace

/// The inverse of a modulo m; they have no common divisor.
static int64_t invert(int64_t a, int64_t m) {
  int64_t x = 1, y = 0;
  for (int64_t rest = m; rest;) {
    int64_t quotient = a / rest;
    a = std::exchange(rest, a - quotient * rest);
    x = std::exchange(y, x - quotient * y);
  }
  return x < 0 ? x + m : x;
}

/// The numbers that are in both.
static bool meet(const Progression &a, const Progression &b,
                 Progression &shared) {
  int64_t high = std::min(a.last(), b.last()), low = std::max(a.low, b.low);
  if (low > high)
    return false;
  if (a.step == 1 && b.step == 1) {
    shared = {low, 1, high - low + 1};
    return true;
  }
  int64_t divisor = std::gcd(a.step, b.step);
  if ((b.low - a.low) % divisor)
    return false;
  __int128 step = __int128(a.step / divisor) * b.step;
  // a.low + a.step * k is b.low modulo b.step.
  int64_t modulus = b.step / divisor;
  int64_t distance = (b.low - a.low) / divisor % modulus;
  __int128 k = __int128(distance) * invert(a.step / divisor % modulus, modulus);
  k %= modulus;
  __int128 first = a.low + a.step * (k < 0 ? k + modulus : k);
  if (first < low)
    first += (low - first + step - 1) / step * step;
  if (first > high)
    return false;
  shared.low = static_cast<int64_t>(first);
  shared.count = static_cast<int64_t>((high - first) / step) + 1;
  shared.step = shared.count > 1 ? static_cast<int64_t>(step) : 1;
  return true;
}

//===----------------------------------------------------------------------===//
// Blocks
//===----------------------------------------------------------------------===//

bool MemoryBlock::operator==(const MemoryBlock &other) const {
  return start == other.start && item == other.item && rank == other.rank &&
         std::equal(dims, dims + rank, other.dims);
}

uint64_t MemoryBlock::end() const {
  int64_t reach = item;
  for (int i = 0; i < rank; ++i)
    reach += dims[i].stride * dims[i].step * (dims[i].count - 1);
  return start + reach;
}

int64_t MemoryBlock::bytes() const {
  int64_t size = item;
  for (int i = 0; i < rank; ++i)
    size *= dims[i].count;
  return size;
}

/// The strides of both, each once, the largest first.
static int collectStrides(const MemoryBlock &a, const MemoryBlock &b,
                          int64_t *strides) {
  int count = 0;
  int i = 0, j = 0;
  while (i < a.rank || j < b.rank) {
    int64_t first = i < a.rank ? a.dims[i].stride : 0;
    int64_t second = j < b.rank ? b.dims[j].stride : 0;
    strides[count++] = std::max(first, second);
    i += first >= second;
    j += second >= first;
  }
  return count;
}

/// False if a digit runs into the next larger stride.
static bool digitsOf(const MemoryBlock &block, uint64_t base,
                     const int64_t *strides, int count, Digits &digits) {
  auto rest = static_cast<int64_t>(block.start - base);
  int64_t room = std::numeric_limits<int64_t>::max();
  int next = 0;
  for (int i = 0; i <= count; ++i) {
    int64_t unit = i < count ? strides[i] : 1;
    Progression &digit = digits.at[i];
    digit = {rest / unit, 1, 1};
    rest %= unit;
    if (i == count) {
      digit.count = block.item;
    } else if (next < block.rank && block.dims[next].stride == unit) {
      digit.step = block.dims[next].step;
      digit.count = block.dims[next++].count;
    }
    if (i > 0 && (digit.last() + 1) > room / unit)
      return false;
    room = unit;
  }
  // The rest has the stride of another dimension.
  return next == block.rank;
}

/// The digits of two blocks from a common base; false if they have none. A row
/// may begin anywhere, so several bases are tried.
static bool digitsOf(const MemoryBlock &a, const MemoryBlock &b,
                     const int64_t *strides, int count, Digits &first,
                     Digits &second) {
  uint64_t low = std::min(a.start, b.start), high = std::max(a.start, b.start);
  for (int i = -1; i < count; ++i) {
    uint64_t base = low;
    if (i >= 0)
      base -= (strides[i] - (high - low) % strides[i]) % strides[i];
    if (digitsOf(a, base, strides, count, first) &&
        digitsOf(b, base, strides, count, second))
      return true;
  }
  return false;
}

bool warp::intersect(const MemoryBlock &a, const MemoryBlock &b,
                     MemoryBlock &shared) {
  if (a.end() <= b.start || b.end() <= a.start)
    return false;
  shared = a;
  if (a == b)
    return true;
  int64_t strides[2 * maxRank];
  int count = collectStrides(a, b, strides);
  Digits first, second;
  if (!digitsOf(a, b, strides, count, first, second))
    return true;
  shared.rank = 0;
  for (int i = 0, next = 0; i <= count; ++i) {
    Progression both;
    if (!meet(first.at[i], second.at[i], both))
      return false;
    if (i == count || next == a.rank || a.dims[next].stride != strides[i])
      continue;
    ++next;
    shared.start += (both.low - first.at[i].low) * strides[i];
    if (both.count > 1)
      shared.dims[shared.rank++] = {strides[i], both.step, both.count};
  }
  return true;
}

bool warp::overlap(const MemoryBlock &a, const MemoryBlock &b) {
  MemoryBlock shared;
  return intersect(a, b, shared);
}

MemoryBlock warp::blockOf(const ArrayDescriptor &array, int64_t itemSize) {
  MemoryBlock block;
  block.start = reinterpret_cast<uint64_t>(array.data);
  block.item = itemSize;
  for (int i = 0; i < array.ndim; ++i) {
    int64_t stride = array.strides[i], extent = array.shape[i];
    if (extent == 0)
      block.item = 0;
    if (extent < 2 || stride == 0)
      continue;
    if (stride < 0)
      block.start += stride * (extent - 1);
    block.dims[block.rank++] = {std::abs(stride), 1, extent};
  }
  std::stable_sort(
      block.dims, block.dims + block.rank,
      [](const auto &a, const auto &b) { return a.stride > b.stride; });
  if (!block.item)
    block.rank = 0;
  return block;
}

//===----------------------------------------------------------------------===//
// Regions
//===----------------------------------------------------------------------===//

/// True if it is known that `b` has all elements of `a`.
static bool isWithin(const MemoryBlock &a, const MemoryBlock &b) {
  if (a == b)
    return true;
  int64_t strides[2 * maxRank];
  int count = collectStrides(a, b, strides);
  Digits first, second;
  if (!digitsOf(a, b, strides, count, first, second))
    return false;
  for (int i = 0; i <= count; ++i) {
    Progression both;
    if (!meet(first.at[i], second.at[i], both) ||
        both.count != first.at[i].count)
      return false;
  }
  return true;
}

void Region::add(const MemoryBlock &block) {
  if (!block.item)
    return;
  for (const MemoryBlock &other : blocks)
    if (::isWithin(block, other))
      return;
  blocks.erase(std::remove_if(blocks.begin(), blocks.end(),
                              [&](const MemoryBlock &other) {
                                return ::isWithin(other, block);
                              }),
               blocks.end());
  blocks.push_back(block);
}

bool Region::overlaps(const Region &other) const {
  for (const MemoryBlock &a : blocks)
    for (const MemoryBlock &b : other.blocks)
      if (overlap(a, b))
        return true;
  return false;
}

Region Region::shared(const Region &other) const {
  Region result;
  MemoryBlock both;
  for (const MemoryBlock &a : blocks)
    for (const MemoryBlock &b : other.blocks)
      if (intersect(a, b, both))
        result.add(both);
  return result;
}

bool Region::isWithin(const Region &other) const {
  return std::all_of(blocks.begin(), blocks.end(), [&](const auto &a) {
    return std::any_of(other.blocks.begin(), other.blocks.end(),
                       [&](const auto &b) { return ::isWithin(a, b); });
  });
}

int64_t Region::bytes() const {
  int64_t size = 0;
  for (const MemoryBlock &block : blocks)
    size += block.bytes();
  return size;
}

size_t Region::hash() const {
  uint64_t value = blocks.size();
  auto mix = [&](uint64_t number) {
    value = (value ^ number) * 0x9E3779B97F4A7C15u;
    value ^= value >> 29;
  };
  for (const MemoryBlock &block : blocks) {
    mix(block.start);
    mix(block.item);
    for (int i = 0; i < block.rank; ++i) {
      mix(block.dims[i].stride * 31 + block.dims[i].step);
      mix(block.dims[i].count);
    }
  }
  return value;
}

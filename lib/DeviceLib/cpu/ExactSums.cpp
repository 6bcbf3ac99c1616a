//===- ExactSums.cpp - Exact sums of many floats at once ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A range of threads that adds to one element collects its terms in a buffer;
// a full buffer is added to the digits of the range (include/warp/ExactSums.h)
// here, by loops that the vectoriser knows:
//
//   A sum in doubles is exact as long as all terms are multiples of a unit and
//   it stays below 2^53 of them. 256 floats of 32 bits allow that if none is
//   2^21 times smaller than the largest. A double is cut in three at two units
//   by adding and subtracting a large number; mostly nothing is left of it
//   after that.
//
// Terms that are too small are added one by one, and so is a buffer with
// infinities or NaN. The order of terms in a buffer makes no difference.
//
//===----------------------------------------------------------------------===//

using i32 = int;
using i64 = long long;
using u32 = unsigned int;
using u64 = unsigned long long;

#define WARP_SUMS extern "C" __attribute__((used))

namespace {

// As include/warp/ExactSums.h has them.
constexpr i64 bufferSize = 256;
constexpr int digitBits = 28;
constexpr i64 digitsOfFloat = 10, digitsOfDouble = 75;
constexpr u64 digitMask = (u64(1) << digitBits) - 1;
constexpr u64 infinityBits = u64(0x7ff) << 52;

/// The sum of a range: digits in units of the least subnormal number, a word of
/// flags after them, and what was touched of those.
struct Sum {
  i64 *digits;
  i32 *touched;
  i64 count;
  /// Binary exponent of the unit.
  i64 unit;

  void add(double value) const;
  void addWord(i64 weight, i64 word) const {
    digits[weight] += word;
    touched[weight] = 1;
  }
};

} // namespace

static u64 bitsOf(double value) { return __builtin_bit_cast(u64, value); }
static double realOf(u64 bits) { return __builtin_bit_cast(double, bits); }

/// Adds a multiple of the unit, or sets a flag.
void Sum::add(double value) const {
  u64 bits = bitsOf(value), magnitude = bits & ~(u64(1) << 63);
  bool isNegative = bits >> 63;
  if (magnitude >= infinityBits) {
    digits[count] |= magnitude > infinityBits ? 4 : isNegative ? 2 : 1;
    touched[count] = 1;
    return;
  }
  i64 field = i64(magnitude >> 52);
  u64 fraction = magnitude & ((u64(1) << 52) - 1);
  fraction |= field ? u64(1) << 52 : 0;
  if (!fraction)
    return;
  i64 shift = (field ? field : 1) - 1075 - unit;
  if (shift < 0) {
    fraction >>= -shift > 63 ? 63 : -shift;
    shift = 0;
  }
  i64 weight = shift / digitBits, rest = shift % digitBits;
  i64 first = i64((fraction << rest) & digitMask);
  i64 second = i64((fraction >> (digitBits - rest)) & digitMask);
  i64 third = i64(fraction >> (2 * digitBits - rest));
  // The last digit takes what a sum has beyond all floats.
  if (weight + 2 >= count) {
    second += third << digitBits;
    third = 0;
  }
  i64 sign = isNegative ? -1 : 1;
  addWord(weight, sign * first);
  if (second)
    addWord(weight + 1, sign * second);
  if (third)
    addWord(weight + 2, sign * third);
}

static void addOneByOne(const Sum &sum, const auto *values, i64 count) {
  for (i64 i = 0; i < count; ++i)
    sum.add(values[i]);
}

WARP_SUMS __attribute__((noinline)) void
warp_flush_sum_f32(const float *values, i64 count, i64 *digits, i32 *touched) {
  Sum sum{digits, touched, digitsOfFloat, -149};
  auto magnitude = [&](i64 i) {
    return __builtin_bit_cast(u32, values[i]) & 0x7fffffffu;
  };
  u32 largest = 0;
  for (i64 i = 0; i < count; ++i)
    largest = magnitude(i) > largest ? magnitude(i) : largest;
  u32 field = largest >> 23;
  if (field == 255)
    return addOneByOne(sum, values, count);
  u32 least = field > 21 ? (field - 21) << 23 : 0;
  double total = 0;
  u32 anySmall = 0;
  {
#pragma clang fp reassociate(on)
    for (i64 i = 0; i < count; ++i) {
      bool isSmall = magnitude(i) < least;
      total += isSmall ? 0.0 : double(values[i]);
      anySmall |= isSmall ? magnitude(i) : 0;
    }
  }
  sum.add(total);
  if (anySmall)
    for (i64 i = 0; i < count; ++i)
      if (magnitude(i) < least)
        sum.add(values[i]);
}

WARP_SUMS __attribute__((noinline)) void
warp_flush_sum_f64(const double *values, i64 count, i64 *digits, i32 *touched) {
  Sum sum{digits, touched, digitsOfDouble, -1074};
  auto magnitude = [&](i64 i) { return bitsOf(values[i]) & ~(u64(1) << 63); };
  u64 largest = 0;
  for (i64 i = 0; i < count; ++i)
    largest = magnitude(i) > largest ? magnitude(i) : largest;
  u64 field = largest >> 52;
  // The units and the large numbers have to be normal.
  if (field < 100 || field > 2000)
    return addOneByOne(sum, values, count);
  // 1.5 * 2^52 units of 2^-42, and then of 2^-86, of the largest.
  constexpr u64 half = u64(1) << 51;
  double large = realOf((field + 10) << 52 | half);
  double small = realOf((field - 34) << 52 | half);
  double high = 0, low = 0;
  u64 anyLeft = 0;
  double left[bufferSize];
  for (i64 i = 0; i < count; ++i) {
    double first = (values[i] + large) - large, rest = values[i] - first;
    double second = (rest + small) - small;
    left[i] = rest - second;
    anyLeft |= bitsOf(left[i]) << 1;
    {
#pragma clang fp reassociate(on)
      high += first;
      low += second;
    }
  }
  sum.add(high);
  sum.add(low);
  if (anyLeft)
    addOneByOne(sum, left, count);
}

WARP_SUMS __attribute__((always_inline)) void
warp_append_to_sum_f32(float *values, i64 *count, i64 *digits, i32 *touched,
                       float value) {
  values[(*count)++] = value;
  if (*count < bufferSize)
    return;
  warp_flush_sum_f32(values, bufferSize, digits, touched);
  *count = 0;
}

WARP_SUMS __attribute__((always_inline)) void
warp_append_to_sum_f64(double *values, i64 *count, i64 *digits, i32 *touched,
                       double value) {
  values[(*count)++] = value;
  if (*count < bufferSize)
    return;
  warp_flush_sum_f64(values, bufferSize, digits, touched);
  *count = 0;
}

//===- DoubleAngles.h - Angles modulo pi/2, 64 bits -----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// As FloatAngles.h: pi/2 in three doubles for angles up to 2^27. A larger one,
// m 2^e with an integer m of 53 bits, is multiplied by 192 bits of 2/pi from
// where the product stops being a multiple of 4: its first two bits are the
// quadrant, the others the fraction of a right angle (M. Payne, R. Hanek,
// "Radian reduction for trigonometric functions", SIGNUM 18, 1983).
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_CPU_DOUBLEANGLES_H
#define WARP_DEVICELIB_CPU_DOUBLEANGLES_H

#include "Lanes.h"

namespace {

using u128 = unsigned __int128;

/// 64 zeros, and the bits of 2/pi behind the point.
constexpr u64 twoOverPiBits[21] = {
    0x0000000000000000, 0xa2f9836e4e441529, 0xfc2757d1f534ddc0,
    0xdb6295993c439041, 0xfe5163abdebbc561, 0xb7246e3a424dd2e0,
    0x06492eea09d1921c, 0xfe1deb1cb129a73e, 0xe88235f52ebb4484,
    0xe99c7026b45f7e41, 0x3991d639835339f4, 0x9c845f8bbdf9283b,
    0x1ff897ffde05980f, 0xef2f118b5a0a6d1f, 0x6d367ecf27cb09b7,
    0x4f463f669e5fea2d, 0x7527bac7ebe5f17b, 0x3d0739f78a5292ea,
    0x6bfb5fb11f8d5d08, 0x56033046fc7b6bab, 0xf0cfbc209af4361d};

/// The bits of 2/pi from a place on.
inline u64 twoOverPiFrom(u32 bit) {
  u32 word = bit / 64, shift = bit % 64;
  u64 next = twoOverPiBits[word + 1] >> 1 >> (63 - shift);
  return twoOverPiBits[word] << shift | next;
}

/// For a double that is finite and positive, at least 2^27.
[[maybe_unused]] __attribute__((noinline)) void
reduceLargeDouble(f64 x, f64 &high, f64 &low, u64 &quadrant) {
  constexpr f64 halfPi = 0x1.921fb54442d18p+0;
  constexpr f64 halfPiLow = 0x1.1a62633145c07p-54;
  u64 bits = cast<u64>(x);
  u64 m = (bits & ((1ull << 52) - 1)) | 1ull << 52;
  // e - 2 bits have a weight of 4 and more; the zeros are for smaller e.
  u32 start = u32(bits >> 52) - 1075 - 2 + 64;
  u128 first = u128(m) * twoOverPiFrom(start + 128);
  u128 second = u128(m) * twoOverPiFrom(start + 64) + u64(first >> 64);
  u64 third = m * twoOverPiFrom(start) + u64(second >> 64);
  // The nearest quadrant: the fraction is in [-1/2, 1/2), 126 bits of it.
  u128 turns = u128(third) << 64 | u64(second);
  quadrant = u64((third >> 61) + 1) >> 1;
  u128 fraction = turns << 2;
  bool negative = fraction >> 127;
  fraction = negative ? -fraction : fraction;
  int zeros = __builtin_clzll(u64(fraction >> 64) | 1);
  fraction <<= zeros;
  f64 unit = cast<f64>(u64(1023 - 64 - zeros) << 52);
  f64 a = f64(u64(fraction >> 75)) * 0x1.0p+11 * unit;
  f64 b = f64(u64(fraction >> 22) & ((1ull << 53) - 1)) * 0x1.0p-42 * unit;
  f64 product = a * halfPi;
  f64 rest = fma(a, halfPi, -product) + fma(a, halfPiLow, b * halfPi);
  f64 sum = product + rest;
  rest = (product - sum) + rest;
  high = negative ? -sum : sum;
  low = negative ? -rest : rest;
}

#pragma clang attribute push(__attribute__((always_inline)),                  \
                             apply_to = function)

template <int n> struct DoubleAngle {
  using D = Lanes<f64, n>;
  using U = Lanes<u64, n>;

  D high, low; // in [-pi/4, pi/4]
  U quadrant;

  /// For a positive angle.
  explicit DoubleAngle(D x) {
    reduceSmall(x);
    auto isLarge = (x > 0x1.0p+27) & (x < __builtin_inf());
    if (__builtin_expect(!any(isLarge), true))
      return;
#pragma clang loop unroll(disable)
    for (int i = 0; i < n; ++i) {
      if (!laneOf(isLarge, i))
        continue;
      f64 oneHigh, oneLow;
      u64 oneQuadrant;
      reduceLargeDouble(laneOf(x, i), oneHigh, oneLow, oneQuadrant);
      setLane(high, i, oneHigh);
      setLane(low, i, oneLow);
      setLane(quadrant, i, oneQuadrant);
    }
  }

  void reduceSmall(D x) {
    constexpr f64 twoOverPi = 0x1.45f306dc9c883p-1, roundToInteger = 0x1.8p+52;
    constexpr f64 halfPi[] = {0x1.921fb54442d18p+0, 0x1.1a62633145c07p-54,
                              -0x1.f1976b7ed8fbcp-110};
    D shifted = fma(x, D(twoOverPi), D(roundToInteger));
    D turns = roundToInteger - shifted;
    D rest = fma(turns, D(halfPi[0]), x);
    D product = turns * halfPi[1];
    D productLow = fma(turns, D(halfPi[1]), -product);
    productLow = fma(turns, D(halfPi[2]), productLow);
    high = rest + product;
    low = ((rest - high) + product) + productLow;
    quadrant = cast<U>(shifted);
  }

  /// sin(high + low) in two parts.
  D sin(D &rest) const { // [2^-57]
    constexpr f64 cube = -0x1.5555555555549p-3;
    constexpr f64 c[] = {0x1.111111110f8a4p-7, -0x1.a01a019c15655p-13,
                         0x1.71de357a076aap-19, -0x1.ae5e67708fe89p-26,
                         0x1.5d9337f1eba1ap-33};
    D z = high * high;
    D factor = fma(z, polynomialOfPairs(z, c), D(cube));
    D tail = fma(high * z, factor, fma(low * z, D(-0.5), low));
    D sum = high + tail;
    rest = (high - sum) + tail;
    return sum;
  }

  /// cos(high + low) in two parts.
  D cos(D &rest) const { // [2^-63]
    constexpr f64 c[] = {0x1.555555555554cp-5,   -0x1.6c16c16c1522ep-10,
                         0x1.a01a019cc1b8ep-16,  -0x1.27e4f814ca33dp-22,
                         0x1.1ee9f2e5b5ae9p-29, -0x1.8fb20e74f9d0fp-37};
    D z = high * high, half = z * 0.5, near = 1.0 - half;
    D tail = fma(z * z, polynomialOfPairs(z, c), -(high * low));
    tail = ((1.0 - near) - half) + tail;
    D sum = near + tail;
    rest = (near - sum) + tail;
    return sum;
  }
};

#pragma clang attribute pop

} // namespace

#endif // WARP_DEVICELIB_CPU_DOUBLEANGLES_H

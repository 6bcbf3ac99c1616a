//===- DoublePower.h - Powers of 64-bit floats ----------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// x^y is 2^(y log2(x)). An error of the logarithm counts up to 1024 times in
// the power, so it is held to 2^-65: with s = (m - 1) / (m + 1) in two parts,
// log(m) is 2 (s + s^3/3 + s^5/5 + s^7 Q(s^2)), where only Q is a plain
// polynomial.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_CPU_DOUBLEPOWER_H
#define WARP_DEVICELIB_CPU_DOUBLEPOWER_H

#include "DoubleMath.h"

namespace {

#pragma clang attribute push(__attribute__((always_inline)),                  \
                             apply_to = function)

template <int n> struct DoublePower {
  using D = Lanes<f64, n>;
  using Math = DoubleMath<n>;

  static constexpr f64 infinity = __builtin_inf();
  static constexpr f64 notANumber = __builtin_nan("");

  /// A number in two parts.
  struct Sum {
    D high, low;
  };

  /// With a low part of no more than half a unit of the high one.
  static Sum normalize(D high, D low) {
    D sum = high + low;
    return {sum, (high - sum) + low};
  }

  static Sum multiply(D a, D aLow, D b, D bLow) {
    D high = a * b, low = fma(a, b, -high);
    return {high, fma(a, bLow, fma(aLow, b, low))};
  }

  /// log((g + f) / (g - f)) / 2 between sqrt(1/2) and sqrt(2), g in two parts.
  static Sum halfLog(D f, D g, D gLow) { // [2^-66]
    constexpr f64 fifth = 0x1.9999999999b2ep-3;
    constexpr f64 c[] = {0x1.24924924580d2p-3, 0x1.c71c722d25b85p-4,
                         0x1.745ce9f4e0d00p-4, 0x1.3b1ee9af5833ap-4,
                         0x1.0f800f3d201e6p-4, 0x1.0e41e32a22b1ap-4};
    constexpr f64 third = 0x1.5555555555555p-2, thirdLow = third / 0x1.0p+54;
    D s = f / g;
    D sLow = fma(-s, gLow, fma(-s, g, f)) / g;
    Sum z = multiply(s, sLow, s, sLow);
    Sum rest = normalize(D(fifth), z.high * polynomialOfPairs(z.high, c));
    rest = multiply(rest.high, rest.low, z.high, z.low);
    D low = rest.low + thirdLow;
    rest = normalize(D(third), rest.high);
    rest = multiply(rest.high, rest.low + low, z.high, z.low);
    rest = multiply(rest.high, rest.low, s, sLow);
    D high = s + rest.high;
    return {high, ((s - high) + rest.high) + (rest.low + sLow)};
  }

  /// For a positive number.
  static Sum log2(D x) {
    constexpr f64 twoLog2OfE = 0x1.71547652b82fep+1;
    constexpr f64 twoLog2OfELow = 0x1.777d0ffda0d24p-55;
    D m, exponent = Math::splitExponent(x, m);
    D g = m + 1.0, gLow = m > 1.0 ? (m - g) + 1.0 : (1.0 - g) + m;
    Sum half = halfLog(m - 1.0, g, gLow);
    Sum log = multiply(half.high, half.low, D(twoLog2OfE), D(twoLog2OfELow));
    D high = exponent + log.high;
    D low = exponent == 0.0 ? D(0.0) : (exponent - high) + log.high;
    return normalize(high, low + log.low);
  }

  /// Special cases as IEEE 754-2019, section 9.2.1, has them for pow.
  static D pow(D x, D y) {
    D base = abs(x), half = y * 0.5;
    Sum log = log2(base);
    log.high = base == 0.0 ? D(-infinity) : log.high;
    log.high = base < infinity ? log.high : base;
    D product = y * log.high;
    D low = fma(y, log.high, -product) + y * log.low;
    low = abs(product) < 1100.0 ? low : D(0.0);
    D value = Math::exp2Parts(limit(product, -1100.0, 1100.0), low).value();
    auto isInteger = trunc(y) == y;
    auto isOdd = isInteger & (trunc(half) != half);
    value = isOdd ? copysign(value, x) : value;
    auto isFinite = (base < infinity) & (abs(y) < infinity);
    value = ((x < 0.0) & !isInteger & isFinite) ? D(notANumber) : value;
    auto isOne = (x == 1.0) | (y == 0.0) |
                 ((x == -1.0) & (abs(y) == infinity));
    return isOne ? D(1.0) : value;
  }
};

#pragma clang attribute pop

} // namespace

#endif // WARP_DEVICELIB_CPU_DOUBLEPOWER_H

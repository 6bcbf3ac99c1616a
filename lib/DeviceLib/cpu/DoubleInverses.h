//===- DoubleInverses.h - Inverse hyperbolic functions, cube roots --------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The argument of the logarithm that an inverse hyperbolic function is has two
// parts, so that no error is made before it.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_CPU_DOUBLEINVERSES_H
#define WARP_DEVICELIB_CPU_DOUBLEINVERSES_H

#include "DoublePower.h"

namespace {

#pragma clang attribute push(__attribute__((always_inline)),                  \
                             apply_to = function)

template <int n> struct DoubleInverses {
  using D = Lanes<f64, n>;
  using U = Lanes<u64, n>;
  using Math = DoubleMath<n>;
  using Power = DoublePower<n>;

  static constexpr f64 notANumber = __builtin_nan("");

  /// log(x + sqrt(x^2 + sign)), sign 1 or -1, x positive.
  static D logWithRoot(D x, f64 sign) {
    auto isLarge = x > 0x1.0p+30;
    D limited = isLarge ? D(1.0) : x;
    D square = limited * limited, squareLow = fma(limited, limited, -square);
    D under = square + sign;
    D above = (square - under) + sign, below = (sign - under) + square;
    D underLow = (square > 1.0 ? above : below) + squareLow;
    D root = sqrt(under);
    D rootLow = (fma(-root, root, under) + underLow) / (root + root);
    rootLow = under > 0.0 ? rootLow : D(0.0);
    D larger = sign > 0.0 ? root : limited, other = sign > 0.0 ? limited : root;
    D high = larger + other, low = ((larger - high) + other) + rootLow;
    // The root is x to all bits of a large one.
    high = isLarge ? x : high;
    low = isLarge ? D(0.0) : low;
    return Math::logOfSum(high, low, isLarge ? D(1.0) : D(0.0));
  }

  static D asinh(D x) {
    constexpr f64 c[] = {-1.0 / 6, 3.0 / 40, -15.0 / 336, 105.0 / 3456,
                         -945.0 / 42240};
    D positive = abs(x), z = x * x;
    D small = fma(positive * z, polynomial(z, c), positive);
    D value = positive < 0x1.0p-6 ? small : logWithRoot(positive, 1.0);
    return copysign(value, x);
  }

  static D acosh(D x) {
    D value = logWithRoot(abs(x), -1.0);
    return x < 1.0 ? D(notANumber) : value;
  }

  /// log(a / b) / 2 with a = 1 + x, b = 1 - x, as k log(2) / 2 and what is left
  /// for b 2^k next to a.
  static D atanh(D x) {
    constexpr f64 halfLn2 = 0x1.62e42fefa2000p-2;
    constexpr f64 halfLn2Low = 0x1.9ef35793c7673p-42;
    D positive = abs(x);
    D a = 1.0 + positive, aLow = (1.0 - a) + positive;
    D b = 1.0 - positive, bLow = (1.0 - b) - positive;
    D fraction, k = Math::splitExponent(a / b, fraction);
    D scale = Math::power(cast<U>(k + Math::roundToInteger) -
                          cast<u64>(Math::roundToInteger));
    b *= scale;
    bLow *= scale;
    auto none = k == 0.0;
    D f = none ? positive + positive : (a - b) + (aLow - bLow);
    D g = none ? D(2.0) : a + b;
    D gLow = (a - g) + b;
    gLow = none ? D(0.0) : (b > a ? (b - g) + a : gLow) + (aLow + bLow);
    auto half = Power::halfLog(f, g, gLow);
    D rest = fma(k, D(halfLn2Low), half.low);
    D value = Math::sum(k * halfLn2, half.high, rest);
    value = positive == 1.0 ? D(__builtin_inf()) : value;
    value = positive > 1.0 ? D(notANumber) : value;
    return copysign(positive < 0x1.0p-30 ? positive : value, x);
  }

  /// x = m 2^(3 q + r): a polynomial in m and two of Newton's steps, the last
  /// with an exact residual.
  static D cbrt(D x) { // [2^-16]
    constexpr f64 c[] = {0x1.cf2ea988406d6p-2, 0x1.cde7765ff748ep-1,
                         -0x1.1038b70e88fe9p-1, 0x1.b710329794d4ep-3,
                         -0x1.309720c39187dp-5};
    constexpr f64 rootOfHalf = 0x1.965fea53d6e3dp-1;
    constexpr f64 rootOfTwo = 0x1.428a2f98d728bp+0;
    constexpr f64 roundToInteger = Math::roundToInteger;
    D m, exponent = Math::splitExponent(abs(x), m);
    D shifted = fma(exponent, D(1.0 / 3), D(roundToInteger));
    D r = fma(shifted - roundToInteger, D(-3.0), exponent);
    D root = polynomial(m, c);
    root = r < 0.0 ? root * rootOfHalf : root;
    root = r > 0.0 ? root * rootOfTwo : root;
    m = r < 0.0 ? m * 0.5 : m;
    m = r > 0.0 ? m + m : m;
    D square = root * root;
    root = fma(fma(-root, square, m), 1.0 / (3.0 * square), root);
    square = root * root;
    D squareLow = fma(root, root, -square);
    D residual = fma(-root, squareLow, fma(-root, square, m));
    root = fma(residual, 1.0 / (3.0 * square), root);
    U q = cast<U>(shifted) - cast<u64>(roundToInteger);
    D value = copysign(root * Math::power(q), x);
    return ((x == 0.0) | !(abs(x) < __builtin_inf())) ? x : value;
  }
};

#pragma clang attribute pop

} // namespace

#endif // WARP_DEVICELIB_CPU_DOUBLEINVERSES_H

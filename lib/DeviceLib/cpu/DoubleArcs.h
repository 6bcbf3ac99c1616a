//===- DoubleArcs.h - Inverse functions of angles, 64 bits ----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// As FloatMath.h, where the forms are explained.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_CPU_DOUBLEARCS_H
#define WARP_DEVICELIB_CPU_DOUBLEARCS_H

#include "DoubleMath.h"

namespace {

#pragma clang attribute push(__attribute__((always_inline)),                  \
                             apply_to = function)

template <int n> struct DoubleArcs {
  using D = Lanes<f64, n>;
  using I = Lanes<i64, n>;
  using Math = DoubleMath<n>;

  static constexpr f64 infinity = __builtin_inf();
  static constexpr f64 halfPi = 0x1.921fb54442d18p+0;
  static constexpr f64 halfPiLow = 0x1.1a62633145c07p-54;

  /// (asin(s) - s) / s for z = s^2 <= 1/4.
  static D asinRest(D z) { // [2^-55]
    constexpr f64 c[] = {0x1.5555555555385p-3, 0x1.333333336fcecp-4,
                         0x1.6db6db41ab352p-5, 0x1.f1c72c78666a4p-6,
                         0x1.6e89ee98d32e5p-6, 0x1.1c6c331b88b16p-6,
                         0x1.c6f7ba432377ep-7, 0x1.8ee9148c3abe4p-7,
                         0x1.aa9161feff6aep-8, 0x1.40c71a9e9713dp-6,
                         -0x1.0b133bfbdf877p-6, 0x1.05d7eee076615p-5};
    return z * polynomialOfPairs(z, c);
  }

  /// An angle in [0, pi/3] in two parts: 2 asin(sqrt((1-x)/2)), x >= 1/2.
  static void acosNearOne(D x, D &high, D &low) {
    D z = fma(x, D(-0.5), D(0.5));
    D s = sqrt(z);
    D residual = fma(-s, s, z) / (s + s);
    residual = z > 0.0 ? residual : D(0.0);
    high = s + s;
    low = fma(high, asinRest(z), residual + residual);
  }

  static D asin(D x) {
    D positive = abs(x), high, low;
    acosNearOne(positive, high, low);
    D large = Math::sum(D(halfPi), -high, halfPiLow - low);
    D small = fma(positive, asinRest(x * x), positive);
    return copysign(positive > 0.5 ? large : small, x);
  }

  static D acos(D x) {
    D positive = abs(x), high, low;
    acosNearOne(positive, high, low);
    D right = high + low;
    D left = Math::sum(D(2 * halfPi), -high, 2 * halfPiLow - low);
    D rest = fma(-x, asinRest(x * x), D(halfPiLow));
    D middle = Math::sum(D(halfPi), -x, rest);
    D outside = x < 0.0 ? left : right;
    return positive > 0.5 ? outside : middle;
  }

  /// As FloatMath's.
  static D angleOf(D small, D large, auto above, auto behind) { // [2^-57]
    constexpr f64 c[] = {-0x1.5555555555517p-2, 0x1.9999999991337p-3,
                         -0x1.2492492168885p-3, 0x1.c71c709466a5dp-4,
                         -0x1.745cf51ea3c9cp-4, 0x1.3b1142978a991p-4,
                         -0x1.10f34dce4d43ep-4, 0x1.dfebcc56b2d60p-5,
                         -0x1.a3a22c7c997b8p-5, 0x1.570fad039eac7p-5,
                         -0x1.c1ce710a757b8p-6, 0x1.4bec37e254671p-7};
    constexpr f64 quarterPi = halfPi / 2, quarterPiLow = halfPiLow / 2;
    D half = large * 0.5, other = small * 0.5, sum = half + other;
    auto diagonal = small > half;
    D sumLow = diagonal ? (half - sum) + other : D(0.0);
    D numerator = diagonal ? other - half : small;
    D denominator = diagonal ? sum : large;
    D ratio = numerator / denominator;
    D residual = fma(-ratio, denominator, numerator);
    D low = fma(-ratio, sumLow, residual) / denominator;
    low = large < infinity ? low : D(0.0);
    auto down = above != behind;
    ratio = down ? -ratio : ratio;
    low = down ? -low : low;
    D eighths = diagonal ? D(1.0) : (above ? D(2.0) : D(0.0));
    eighths = behind ? 4.0 - eighths : eighths;
    // The last three bits of a quarter of pi are 0.
    D base = eighths * quarterPi, z = ratio * ratio;
    D high = base + ratio;
    low = fma(eighths, D(quarterPiLow), low);
    low = ((base - high) + ratio) + low;
    return high + fma(ratio * z, polynomialOfPairs(z, c), low);
  }

  static D atan(D x) {
    D positive = abs(x);
    auto above = positive > 1.0;
    D small = above ? D(1.0) : positive, large = above ? positive : D(1.0);
    return copysign(angleOf(small, large, above, above != above), x);
  }

  static D atan2(D y, D x) {
    D a = abs(x), b = abs(y);
    auto infinite = (a == infinity) & (b == infinity);
    a = (infinite | ((a == 0.0) & (b == 0.0))) ? D(1.0) : a;
    b = infinite ? D(1.0) : b;
    auto above = b > a;
    D large = above ? b : a, small = above ? a : b;
    auto tiny = large < 0x1.0p-512;
    large = tiny ? large * 0x1.0p+512 : large;
    small = tiny ? small * 0x1.0p+512 : small;
    auto behind = cast<I>(x) < 0;
    return copysign(angleOf(small, large, above, behind), y);
  }
};

#pragma clang attribute pop

} // namespace

#endif // WARP_DEVICELIB_CPU_DOUBLEARCS_H

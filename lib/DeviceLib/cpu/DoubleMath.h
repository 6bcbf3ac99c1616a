//===- DoubleMath.h - Elementary functions of 64-bit floats ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// As FloatMath.h, where the forms are explained: a large term in two parts plus
// a small polynomial, no more than one unit in the last place off.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_CPU_DOUBLEMATH_H
#define WARP_DEVICELIB_CPU_DOUBLEMATH_H

#include "DoubleAngles.h"

namespace {

#pragma clang attribute push(__attribute__((always_inline)),                  \
                             apply_to = function)

template <int n> struct DoubleMath {
  using D = Lanes<f64, n>;
  using I = Lanes<i64, n>;
  using U = Lanes<u64, n>;

  static constexpr f64 infinity = __builtin_inf();
  static constexpr f64 notANumber = __builtin_nan("");
  static constexpr f64 roundToInteger = 0x1.8p+52;
  static constexpr u64 signBit = 1ull << 63;

  static U signOf(D x) { return cast<U>(x) & signBit; }
  static D flip(D x, U sign) { return cast<D>(cast<U>(x) ^ sign); }

  /// a + b + c, rounded nearly once, where a is 0 or larger than b and c small.
  static D sum(D a, D b, D c) {
    D high = a + b;
    return high + (((a - high) + b) + c);
  }

  //===--------------------------------------------------------------------===//
  // Angles
  //===--------------------------------------------------------------------===//

  static D sin(D x) {
    DoubleAngle<n> a(abs(x));
    D rest;
    D value = (a.quadrant & 1) != 0 ? a.cos(rest) : a.sin(rest);
    return flip(value, (a.quadrant << 62 & signBit) ^ signOf(x));
  }

  static D cos(D x) {
    DoubleAngle<n> a(abs(x));
    D rest;
    D value = (a.quadrant & 1) != 0 ? a.sin(rest) : a.cos(rest);
    return flip(value, (a.quadrant + 1) << 62 & signBit);
  }

  static D tan(D x) {
    DoubleAngle<n> a(abs(x));
    D sinRest, cosRest, s = a.sin(sinRest), c = a.cos(cosRest);
    auto odd = (a.quadrant & 1) != 0;
    D value = divide(odd ? c : s, odd ? cosRest : sinRest, odd ? s : c,
                     odd ? sinRest : cosRest);
    return flip(value, (a.quadrant << 63) ^ signOf(x));
  }

  /// (a + aLow) / (b + bLow)
  static D divide(D a, D aLow, D b, D bLow) {
    D inverse = 1.0 / b, ratio = a * inverse;
    D residual = fma(-ratio, b, a) + fma(-ratio, bLow, aLow);
    D correction = residual * inverse;
    // Infinite ratios have no residual.
    return ratio + (abs(ratio) < infinity ? correction : D(0.0));
  }

  //===--------------------------------------------------------------------===//
  // Exponential functions
  //===--------------------------------------------------------------------===//

  /// (1 + r + r^2/2 + rest) 2^k; |r| <= 0.35, and k + 2048 is positive.
  struct Scaled {
    D r, square, rest;
    U shifted;

    D value() const { return scale(1.0 + r, lowOfSum()); }
    D lowOfSum() const {
      return ((1.0 - (1.0 + r)) + r) + fma(square, D(0.5), rest);
    }

    /// Without `from` of the 1, in two parts; 0 <= from <= 1/2 or 1 <= from.
    D without(D from, D &low) const {
      D one = 1.0 - from, first = one + r;
      D second = fma(square, D(0.5), first);
      low = ((one - first) + r) + (((1.0 - one) - from) + rest);
      low += fma(square, D(0.5), first - second);
      low = fma(fma(r, r, -square), D(0.5), low);
      return second;
    }

    /// Rounds once, to subnormal numbers and infinity too.
    D scale(D a, D b) const {
      U first = shifted >> 1;
      return (a + b) * power(first - 1024) * power(shifted - first - 1024);
    }
  };

  /// 2^k of a normal exponent.
  static D power(U k) { return cast<D>((k + 1023) << 52); }

  /// e^(r + low) 2^k, where k was rounded to an integer by roundToInteger.
  static Scaled expOf(D r, D low, D shifted) { // [2^-63]
    constexpr f64 c[] = {0x1.555555555555cp-3,  0x1.5555555555558p-5,
                         0x1.111111110e9d8p-7,  0x1.6c16c16c14fe3p-10,
                         0x1.a01a01b45a77fp-13, 0x1.a01a01ad8b04ap-16,
                         0x1.71ddee2ffba1cp-19, 0x1.27e4cbf26f747p-22,
                         0x1.af6f01c112d63p-26, 0x1.1f8c1045e9983p-29};
    U k = cast<U>(shifted) - cast<u64>(roundToInteger) + 2048;
    D square = r * r;
    return {r, square, fma(square * r, polynomialOfPairs(r, c), low), k};
  }

  static Scaled expParts(D x) {
    D r, low, shifted = splitExp(x, r, low);
    return expOf(r, low, shifted);
  }

  /// e^(x + xLow)
  static Scaled expParts(D x, D xLow) {
    D r, low, shifted = splitExp(x, r, low);
    low += xLow;
    D sum = r + low;
    return expOf(sum, (r - sum) + low, shifted);
  }

  /// x = k log(2) + r + low; k is left with roundToInteger added.
  static D splitExp(D x, D &r, D &low) {
    constexpr f64 log2OfE = 0x1.71547652b82fep+0;
    constexpr f64 ln2 = 0x1.62e42fefa39efp-1, ln2Low = 0x1.abc9e3b39803fp-56;
    D shifted = fma(x, D(log2OfE), D(roundToInteger));
    D k = roundToInteger - shifted;
    D rest = fma(k, D(ln2), x);
    r = fma(k, D(ln2Low), rest);
    low = fma(k, D(ln2Low), rest - r);
    return shifted;
  }

  /// 2^(x + low)
  static Scaled exp2Parts(D x, D low) {
    constexpr f64 ln2 = 0x1.62e42fefa39efp-1, ln2Low = 0x1.abc9e3b39803fp-56;
    D shifted = x + roundToInteger;
    D fraction = x - (shifted - roundToInteger);
    D r = fraction * ln2;
    D rLow = fma(fraction, D(ln2), -r) + fma(low, D(ln2), fraction * ln2Low);
    D sum = r + rLow;
    return expOf(sum, (r - sum) + rLow, shifted);
  }

  static D exp(D x) { return expParts(limit(x, -746.0, 710.0)).value(); }
  static D exp2(D x) {
    return exp2Parts(limit(x, -1080.0, 1025.0), D(0.0)).value();
  }

  static D expm1(D x) {
    Scaled s = expParts(limit(x, -50.0, 710.0));
    D low, high = s.without(inversePower(s), low);
    D value = s.scale(high, low);
    return copysign(abs(x) < 0x1.0p-60 ? x : value, x);
  }

  /// 2^-k for k >= -100, and 2^-100 where that is less.
  static D inversePower(Scaled s) {
    U k = s.shifted > 2148 ? U(2148) : s.shifted;
    return power(2048 - k);
  }

  static D sinh(D x) { // [2^-61]
    constexpr f64 c[] = {0x1.5555555555556p-3,  0x1.1111111111026p-7,
                         0x1.a01a01a035dddp-13, 0x1.71de3a3c31fc2p-19,
                         0x1.ae646efa99220p-26, 0x1.61175712e0157p-33,
                         0x1.b5ab1c3e8f444p-41};
    D positive = abs(x), z = x * x;
    D small = fma(x * z, polynomialOfPairs(z, c), x);
    Scaled s = expParts(limit(positive, 0.0, 711.0));
    D large = half(s, -inverseOf(s));
    return positive < 1.0 ? small : copysign(large, x);
  }

  static D cosh(D x) {
    Scaled s = expParts(limit(abs(x), 0.0, 711.0));
    return half(s, inverseOf(s));
  }

  /// (s + other) / 2
  static D half(Scaled s, D other) {
    Scaled half = s;
    half.shifted -= 1;
    return half.scale(1.0 + s.r, s.lowOfSum() + other);
  }

  /// 1/s in units of 2^k of s, which is positive.
  static D inverseOf(Scaled s) {
    D first = 1.0 + s.r, rest = s.lowOfSum();
    D sum = first + rest, low = (first - sum) + rest;
    D inverse = 1.0 / sum;
    inverse = fma(-inverse, low * inverse, inverse);
    D scale = inversePower(s);
    return inverse * scale * scale;
  }

  /// m / (m + 2), m = e^2x - 1.
  static D tanh(D x) {
    D positive = abs(x);
    Scaled s = expParts(limit(positive + positive, 0.0, 40.0));
    D scale = power(s.shifted - 2048);
    D low, high = s.without(inversePower(s), low), sum = high + low;
    D m = sum * scale, mLow = ((high - sum) + low) * scale;
    D d = m + 2.0, dLow = m > 2.0 ? (m - d) + 2.0 : (2.0 - d) + m;
    D value = divide(m, mLow, d, dLow + mLow);
    return copysign(positive < 0x1.0p-60 ? positive : value, x);
  }

  //===--------------------------------------------------------------------===//
  // Logarithms
  //===--------------------------------------------------------------------===//

  /// x = 2^exponent (1 + f), and log(1 + f) = high + low.
  struct Logarithm {
    D exponent, high, low;
  };

  /// The exponent of a positive normal number as a whole number, and the bits
  /// of its fraction between 1/sqrt(2) and sqrt(2).
  static D splitExponent(D x, D &fraction) {
    constexpr u64 sqrtHalf = 0x3fe6a09e667f3bcd;
    auto subnormal = x < 0x1.0p-1022;
    U bits = cast<U>(subnormal ? x * 0x1.0p+54 : x);
    // Arithmetic shifts of 64 bits are slow before AVX-512; this is positive.
    U biased = (bits - sqrtHalf + (1024ull << 52)) >> 52;
    D exponent = cast<D>(biased | 0x4330000000000000ull) - (0x1.0p+52 + 1024.0);
    fraction = cast<D>(bits - ((biased - 1024) << 52));
    return subnormal ? exponent - 54.0 : exponent;
  }

  /// log(1 + f) = f - f^2/2 + s (f^2/2 + R), s = f / (2 + f), as in fdlibm.
  static Logarithm splitLog(D x) { // [2^-58]
    constexpr f64 c[] = {0x1.5555555555593p-1, 0x1.999999997faffp-2,
                         0x1.2492494218a70p-2, 0x1.c71c51e769252p-3,
                         0x1.74664641615aep-3, 0x1.39a0f3e712669p-3,
                         0x1.2f0d8d50f1786p-3};
    D m, exponent = splitExponent(x, m);
    D f = m - 1.0, s = f / (2.0 + f), z = s * s;
    D square = f * f, high = fma(square, D(-0.5), f);
    D low = fma(square, D(-0.5), f - high);
    low = fma(fma(f, f, -square), D(-0.5), low);
    D rest = fma(z, polynomialOfPairs(z, c), square * 0.5);
    return {exponent, high, fma(s, rest, low)};
  }

  static D finishLog(D x, D result) {
    D special = x < 0.0 ? D(notANumber) : x;
    special = x == 0.0 ? D(-infinity) : special;
    return ((x > 0.0) & (x < infinity)) ? result : special;
  }

  static D log(D x) {
    constexpr f64 ln2 = 0x1.62e42fefa2000p-1, ln2Low = 0x1.9ef35793c7673p-41;
    Logarithm l = splitLog(x);
    D low = fma(l.exponent, D(ln2Low), l.low);
    return finishLog(x, sum(l.exponent * ln2, l.high, low));
  }

  /// exponent * unit + (high + low) * factor; factors in two parts.
  static D scaledLog(Logarithm l, f64 unit, f64 unitLow, f64 factor,
                     f64 factorLow) {
    D product = l.high * factor;
    D low = fma(l.high, D(factor), -product);
    low = fma(l.high, D(factorLow), low);
    low = fma(l.exponent, D(unitLow), low);
    low = fma(l.low, D(factor), low);
    return sum(l.exponent * unit, product, low);
  }

  static D log2(D x) {
    return finishLog(x, scaledLog(splitLog(x), 1.0, 0.0, 0x1.71547652b82fep+0,
                                  0x1.777d0ffda0d24p-56));
  }

  static D log10(D x) {
    return finishLog(x, scaledLog(splitLog(x), 0x1.34413509f4000p-2,
                                  0x1.cff7988f8959bp-41, 0x1.bcb7b1526e50ep-2,
                                  0x1.95355baaafad3p-57));
  }

  /// log(high + low) + shift log(2), where low is small.
  static D logOfSum(D high, D low, D shift) {
    constexpr f64 ln2 = 0x1.62e42fefa2000p-1, ln2Low = 0x1.9ef35793c7673p-41;
    Logarithm l = splitLog(high);
    D exponent = l.exponent + shift;
    D rest = fma(exponent, D(ln2Low), fma(low, 1.0 / high, l.low));
    return finishLog(high, sum(exponent * ln2, l.high, rest));
  }

  static D log1p(D x) {
    D high = 1.0 + x;
    D low = x > 1.0 ? 1.0 - (high - x) : x - (high - 1.0);
    D value = logOfSum(high, low, D(0.0));
    return abs(x) < 0x1.0p-40 ? fma(x * x, D(-0.5), x) : value;
  }
};

#pragma clang attribute pop

} // namespace

#endif // WARP_DEVICELIB_CPU_DOUBLEMATH_H

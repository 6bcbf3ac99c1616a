//===- FloatMath.h - Elementary functions of 32-bit floats ----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// No function is off by more than one unit in the last place. Most compute in
// floats: the argument is reduced so that the result is a large term, known
// exactly or with a low part, plus a small polynomial, and the rounding of the
// last sum is nearly the whole error. Special cases are selects at the end.
//
// Polynomials are near the best ones of their degree with float coefficients;
// the error relative to the function is in brackets.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_CPU_FLOATMATH_H
#define WARP_DEVICELIB_CPU_FLOATMATH_H

#include "FloatAngles.h"

namespace {

#pragma clang attribute push(__attribute__((always_inline)),                  \
                             apply_to = function)

template <int n> struct FloatMath {
  using F = Lanes<f32, n>;
  using D = Lanes<f64, n>;
  using I = Lanes<i32, n>;
  using U = Lanes<u32, n>;

  static constexpr f32 infinity = __builtin_inff();
  static constexpr f32 notANumber = __builtin_nanf("");
  static constexpr f32 roundToInteger = 0x1.8p+23f;
  static constexpr u32 signBit = 0x80000000u;

  static U signOf(F x) { return cast<U>(x) & signBit; }
  static F flip(F x, U sign) { return cast<F>(cast<U>(x) ^ sign); }

  /// a + b + c, rounded nearly once, where a is 0 or larger than b and c small.
  static F sum(F a, F b, F c) {
    F high = a + b;
    return high + (((a - high) + b) + c);
  }

  //===--------------------------------------------------------------------===//
  // Angles
  //===--------------------------------------------------------------------===//

  static F sin(F x) {
    FloatAngle<n> a(abs(x));
    F value = (a.quadrant & 1) != 0 ? a.cos() : a.sin();
    return flip(value, (a.quadrant << 30 & signBit) ^ signOf(x));
  }

  static F cos(F x) {
    FloatAngle<n> a(abs(x));
    F value = (a.quadrant & 1) != 0 ? a.sin() : a.cos();
    return flip(value, (a.quadrant + 1) << 30 & signBit);
  }

  /// In odd quadrants -1/tangent, of a tangent in two parts.
  static F tan(F x) { // [2^-29]
    constexpr f32 c[] = {0x1.555564p-2f, 0x1.110cacp-3f,   0x1.bb015ep-5f,
                         0x1.5b3d32p-6f, 0x1.6a5772p-7f, -0x1.845654p-13f,
                         0x1.2784e2p-8f};
    FloatAngle<n> a(abs(x));
    F z = a.high * a.high;
    // The rounding errors of the angle and its square, taken from the tangent.
    F low = fma(a.low * z, fma(z, F(0.8f), F(1.0f)), a.low);
    low = fma(a.high * 0.5f, fma(a.high, a.high, -z), low);
    F rest = fma(a.high * z, polynomial(z, c), low);
    F high = a.high + rest;
    low = (a.high - high) + rest;
    F inverse = -1.0f / high;
    F residual = fma(inverse, low, fma(inverse, high, F(1.0f)));
    inverse = fma(inverse, residual, inverse);
    F value = (a.quadrant & 1) != 0 ? inverse : high;
    return flip(value, signOf(x));
  }

  //===--------------------------------------------------------------------===//
  // Inverse functions of angles
  //===--------------------------------------------------------------------===//

  static constexpr f32 halfPi = 0x1.921fb6p+0f, halfPiLow = -0x1.777a5cp-25f;

  /// (asin(s) - s) / s for z = s^2 <= 1/4.
  static F asinRest(F z) { // [2^-27]
    constexpr f32 c[] = {0x1.5555cap-3f, 0x1.330176p-4f, 0x1.74878ap-5f,
                         0x1.8bdb62p-6f, 0x1.59a3fap-5f};
    return z * polynomial(z, c);
  }

  /// An angle in [0, pi/3] in two parts: 2 asin(sqrt((1-x)/2)), x >= 1/2.
  static void acosNearOne(F x, F &high, F &low) {
    F z = fma(x, F(-0.5f), F(0.5f));
    F s = sqrt(z);
    F residual = fma(-s, s, z) / (s + s);
    residual = z > 0.0f ? residual : F(0.0f);
    high = s + s;
    low = fma(high, asinRest(z), residual + residual);
  }

  static F asin(F x) {
    F positive = abs(x), high, low;
    acosNearOne(positive, high, low);
    F large = sum(F(halfPi), -high, halfPiLow - low);
    F small = fma(positive, asinRest(x * x), positive);
    return copysign(positive > 0.5f ? large : small, x);
  }

  static F acos(F x) {
    F positive = abs(x), high, low;
    acosNearOne(positive, high, low);
    F right = high + low;
    F left = sum(F(2 * halfPi), -high, 2 * halfPiLow - low);
    F rest = fma(-x, asinRest(x * x), F(halfPiLow));
    F middle = sum(F(halfPi), -x, rest);
    F outside = x < 0.0f ? left : right;
    return positive > 0.5f ? outside : middle;
  }

  /// The angle of a point in the upper half plane from the smaller and the
  /// larger of its coordinates without signs, where `above` says that y is the
  /// larger and `behind` that x is negative. Taken from the nearest of three
  /// axes in a quarter, it is at most atan(1/2).
  static F angleOf(F small, F large, auto above, auto behind) { // [2^-28]
    constexpr f32 c[] = {-0x1.555514p-2f, 0x1.997b9ep-3f, -0x1.22512ap-3f,
                         0x1.a046c8p-4f, -0x1.a4df50p-5f};
    F half = large * 0.5f, other = small * 0.5f, sum = half + other;
    auto diagonal = small > half;
    F sumLow = diagonal ? (half - sum) + other : F(0.0f);
    F numerator = diagonal ? other - half : small;
    F denominator = diagonal ? sum : large;
    F ratio = numerator / denominator;
    F residual = fma(-ratio, denominator, numerator);
    F low = fma(-ratio, sumLow, residual) / denominator;
    low = large < infinity ? low : F(0.0f);
    auto down = above != behind;
    ratio = down ? -ratio : ratio;
    low = down ? -low : low;
    F eighths = diagonal ? F(1.0f) : (above ? F(2.0f) : F(0.0f));
    eighths = behind ? 4.0f - eighths : eighths;
    F base = eighths * 0x1.921fb0p-1f, z = ratio * ratio;
    F high = base + ratio;
    low = fma(eighths, F(0x1.5110b4p-23f), low);
    low = ((base - high) + ratio) + low;
    return high + fma(ratio * z, polynomial(z, c), low);
  }

  static F atan(F x) {
    F positive = abs(x);
    auto above = positive > 1.0f;
    F small = above ? F(1.0f) : positive, large = above ? positive : F(1.0f);
    return copysign(angleOf(small, large, above, above != above), x);
  }

  static F atan2(F y, F x) {
    F a = abs(x), b = abs(y);
    // Both infinite stand for a diagonal; both zero for the axis x points
    // along. Small ones are enlarged so that the residual is a number.
    auto infinite = (a == infinity) & (b == infinity);
    a = (infinite | ((a == 0.0f) & (b == 0.0f))) ? F(1.0f) : a;
    b = infinite ? F(1.0f) : b;
    auto above = b > a;
    F large = above ? b : a, small = above ? a : b;
    auto tiny = large < 0x1.0p-64f;
    large = tiny ? large * 0x1.0p+64f : large;
    small = tiny ? small * 0x1.0p+64f : small;
    auto behind = cast<I>(x) < 0;
    return copysign(angleOf(small, large, above, behind), y);
  }

  //===--------------------------------------------------------------------===//
  // Exponential functions
  //===--------------------------------------------------------------------===//

  /// (high + low) 2^exponent; low is less than a tenth of high.
  struct Scaled {
    F high, low;
    I exponent;

    /// Rounds once, to subnormal numbers and infinity too.
    F value() const {
      I first = exponent >> 1;
      return (high + low) * power(first) * power(exponent - first);
    }
  };

  /// 2^k of a normal exponent.
  static F power(I k) { return cast<F>(cast<U>(k + 127) << 23); }

  static Scaled expParts(F x) { // [2^-27]
    constexpr f32 log2OfE = 0x1.715476p+0f;
    constexpr f32 ln2 = 0x1.62e430p-1f, ln2Low = -0x1.05c610p-29f;
    constexpr f32 c[] = {0x1.000000p-1f, 0x1.555488p-3f, 0x1.5554d2p-5f,
                         0x1.124098p-7f, 0x1.6d6638p-10f};
    F shifted = fma(x, F(log2OfE), F(roundToInteger));
    F k = roundToInteger - shifted;
    F rest = fma(k, F(ln2), x);
    F r = fma(k, F(ln2Low), rest);
    F low = fma(k, F(ln2Low), rest - r);
    low = fma(r * r, polynomial(r, c), low);
    F high = 1.0f + r;
    return {high, ((1.0f - high) + r) + low, exponentOf(shifted)};
  }

  static I exponentOf(F shifted) {
    return cast<I>(shifted) - cast<i32>(roundToInteger);
  }

  static F exp(F x) {
    Scaled s = expParts(limit(x, -104.0f, 89.0f));
    return s.value();
  }

  static F exp2(F x) { // [2^-27]
    constexpr f32 ln2 = 0x1.62e430p-1f, ln2Low = -0x1.05c610p-29f;
    constexpr f32 c[] = {ln2Low,         0x1.ebfbe0p-3f,  0x1.c6af84p-5f,
                         0x1.3b2a3cp-7f, 0x1.5f06a4p-10f, 0x1.4431a6p-13f};
    x = limit(x, -151.0f, 129.0f);
    F shifted = x + roundToInteger;
    F r = x - (shifted - roundToInteger);
    F sum = fma(r, F(ln2), r * polynomial(r, c));
    return Scaled{F(1.0f), sum, exponentOf(shifted)}.value();
  }

  static F sinh(F x) { // [2^-31]
    constexpr f32 c[] = {0x1.555556p-3f, 0x1.1110eap-7f, 0x1.a01c1ep-13f,
                         0x1.7677f8p-19f};
    F positive = abs(x), z = x * x;
    F small = fma(x * z, polynomial(z, c), x);
    Scaled s = expParts(limit(positive, 0.0f, 100.0f));
    F other = inverseOf(s);
    Scaled large{s.high, s.low - other, s.exponent - 1};
    return positive < 1.0f ? small : copysign(large.value(), x);
  }

  static F cosh(F x) {
    Scaled s = expParts(limit(abs(x), 0.0f, 100.0f));
    return Scaled{s.high, s.low + inverseOf(s), s.exponent - 1}.value();
  }

  /// 1/s in units of 2^exponent of s, which is positive.
  static F inverseOf(Scaled s) {
    I shift = -2 * s.exponent;
    F sum = s.high + s.low, low = (s.high - sum) + s.low;
    F inverse = 1.0f / sum;
    inverse = fma(-inverse, low * inverse, inverse);
    return inverse * power(shift < -100 ? I(-100) : shift);
  }

  static F tanh(F x) { // [2^-30]
    constexpr f32 c[] = {-0x1.555552p-2f, 0x1.111046p-3f,  -0x1.b9f918p-5f,
                         0x1.64d834p-6f,  -0x1.19585ap-7f, 0x1.92335cp-9f,
                         -0x1.b5f3d2p-11f, 0x1.f7b688p-14f};
    F positive = abs(x), z = x * x;
    F small = fma(positive * z, polynomial(z, c), positive);
    Scaled s = expParts(limit(positive + positive, 0.0f, 20.0f));
    F e = (s.high + s.low) * power(s.exponent);
    F large = 1.0f - 2.0f / (e + 1.0f);
    return copysign(positive < 1.0f ? small : large, x);
  }

  //===--------------------------------------------------------------------===//
  // Logarithms
  //===--------------------------------------------------------------------===//

  /// x = 2^exponent (1 + f), |f| <= 1/3, and log(1 + f) = high + low.
  struct Logarithm {
    F exponent, high, low;
  };

  static Logarithm splitLog(F x) { // [2^-30]
    constexpr f32 c[] = {0x1.555558p-2f,  -0x1.ffff06p-3f, 0x1.9996dap-3f,
                         -0x1.559a78p-3f, 0x1.2504bcp-3f,  -0x1.f3643ap-4f,
                         0x1.b7344ep-4f,  -0x1.075fa2p-3f, 0x1.f06756p-4f};
    constexpr u32 twoThirds = 0x3f2aaaab;
    auto subnormal = x < 0x1.0p-126f;
    U bits = cast<U>(subnormal ? x * 0x1.0p+23f : x);
    I exponent = cast<I>(bits - twoThirds) >> 23;
    F f = cast<F>(bits - (cast<U>(exponent) << 23)) - 1.0f;
    F e = convert<F>(exponent);
    e = subnormal ? e - 23.0f : e;
    // f - f^2/2 exactly, and the rest of the series.
    F square = f * f, high = fma(square, F(-0.5f), f);
    F low = fma(square, F(-0.5f), f - high);
    low = fma(fma(f, f, -square), F(-0.5f), low);
    return {e, high, fma(square * f, polynomial(f, c), low)};
  }

  static F finishLog(F x, F result) {
    F special = x < 0.0f ? F(notANumber) : x;
    special = x == 0.0f ? F(-infinity) : special;
    return ((x > 0.0f) & (x < infinity)) ? result : special;
  }

  static F log(F x) {
    constexpr f32 ln2 = 0x1.62e400p-1f, ln2Low = 0x1.7f7d1cp-20f;
    Logarithm l = splitLog(x);
    F low = fma(l.exponent, F(ln2Low), l.low);
    return finishLog(x, sum(l.exponent * ln2, l.high, low));
  }

  /// exponent * unit + (high + low) * factor; factors in two parts.
  static F scaledLog(Logarithm l, f32 unit, f32 unitLow, f32 factor,
                     f32 factorLow) {
    F product = l.high * factor;
    F low = fma(l.high, F(factor), -product);
    low = fma(l.high, F(factorLow), low);
    low = fma(l.exponent, F(unitLow), low);
    low = fma(l.low, F(factor), low);
    return sum(l.exponent * unit, product, low);
  }

  static F log2(F x) {
    Logarithm l = splitLog(x);
    return finishLog(x, scaledLog(l, 1.0f, 0.0f, 0x1.715476p+0f,
                                  0x1.4ae0c0p-26f));
  }

  static F log10(F x) {
    Logarithm l = splitLog(x);
    return finishLog(x, scaledLog(l, 0x1.344000p-2f, 0x1.3509f8p-18f,
                                  0x1.bcb7b2p-2f, -0x1.5b235ep-27f));
  }
};

#pragma clang attribute pop

} // namespace

#endif // WARP_DEVICELIB_CPU_FLOATMATH_H

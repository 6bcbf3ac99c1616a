//===- FloatPower.h - Powers of 32-bit floats -----------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// x^y is 2^(y log2(x)), evaluated in double: an error of the logarithm counts
// 128 times in the power, and the 29 bits to spare hold that.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_CPU_FLOATPOWER_H
#define WARP_DEVICELIB_CPU_FLOATPOWER_H

#include "Lanes.h"

namespace {

#pragma clang attribute push(__attribute__((always_inline)),                  \
                             apply_to = function)

template <int n> struct FloatPower {
  using F = Lanes<f32, n>;
  using D = Lanes<f64, n>;
  using I = Lanes<i64, n>;
  using U = Lanes<u64, n>;

  static constexpr f64 infinity = __builtin_inf();
  static constexpr f64 notANumber = __builtin_nan("");

  /// 2^x; |x| may be as large as 2^10 without over- or underflow.
  static D exp2(D x) { // [2^-40]
    constexpr f64 c[] = {0x1.0000000000000p+0,  0x1.62e42fef84cdbp-1,
                         0x1.ebfbdff823ce7p-3,  0x1.c6b08dd7004bap-5,
                         0x1.3b2ab7181c555p-7,  0x1.5d8745a35e369p-10,
                         0x1.4308ac8390f53p-13, 0x1.00dc4cd9e7a19p-16,
                         0x1.63d1390345570p-20};
    constexpr f64 roundToInteger = 0x1.8p+52;
    D shifted = x + roundToInteger;
    D fraction = x - (shifted - roundToInteger);
    D scale = cast<D>((cast<U>(shifted) + 1023) << 52);
    return polynomial(fraction, c) * scale;
  }

  /// For a positive normal number.
  static D log2(D x) { // [2^-45]
    constexpr f64 c[] = {0x1.71547652b8251p+1, 0x1.ec709dc53bfcfp-1,
                         0x1.2776c2935a8c1p-1, 0x1.a61a2ef4051f3p-2,
                         0x1.4795463b406c3p-2, 0x1.21b245a850e1dp-2};
    constexpr u64 sqrtHalf = 0x3fe6a09e667f3bcd;
    U bits = cast<U>(x);
    // Arithmetic shifts of 64 bits are slow before AVX-512; this is positive.
    U biased = (bits - sqrtHalf + (1024ull << 52)) >> 52;
    D exponent = cast<D>(biased | 0x4330000000000000ull) -
                 (0x1.0p+52 + 1024.0);
    D m = cast<D>(bits - ((biased - 1024) << 52));
    D s = (m - 1.0) / (m + 1.0);
    return fma(s, polynomial(s * s, c), exponent);
  }

  /// Special cases as IEEE 754-2019, section 9.2.1, has them for pow.
  static F pow(F x, F y) {
    D signedBase = convert<D>(x), base = abs(signedBase);
    D exponent = convert<D>(y), half = exponent * 0.5;
    D logarithm = log2(base);
    logarithm = base == 0.0 ? D(-infinity) : logarithm;
    logarithm = base < infinity ? logarithm : base;
    D value = exp2(limit(exponent * logarithm, -1000.0, 1000.0));
    auto isInteger = trunc(exponent) == exponent;
    auto isOdd = isInteger & (trunc(half) != half);
    value = isOdd ? copysign(value, signedBase) : value;
    auto isFinite = (base < infinity) & (abs(exponent) < infinity);
    auto isInvalid = (signedBase < 0.0) & !isInteger & isFinite;
    value = isInvalid ? D(notANumber) : value;
    auto isOne = (signedBase == 1.0) | (exponent == 0.0) |
                 ((signedBase == -1.0) & (abs(exponent) == infinity));
    return convert<F>(isOne ? D(1.0) : value);
  }
};

#pragma clang attribute pop

} // namespace

#endif // WARP_DEVICELIB_CPU_FLOATPOWER_H

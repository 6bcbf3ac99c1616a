//===- DoubleErrors.h - Error functions -----------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Near zero erf is x times a polynomial; elsewhere erfc(a) is e^(-a^2) times
// P(q) / (1 + 2 a), q = (a - 4) / (a + 4), where P changes little (cf. M.
// Shepherd, J. Laframboise, "Chebyshev approximation of (1 + 2x) exp(x^2)
// erfc x", Mathematics of Computation 36, 1981).
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_CPU_DOUBLEERRORS_H
#define WARP_DEVICELIB_CPU_DOUBLEERRORS_H

#include "DoubleMath.h"

namespace {

#pragma clang attribute push(__attribute__((always_inline)),                  \
                             apply_to = function)

template <int n> struct DoubleErrors {
  using D = Lanes<f64, n>;
  using Math = DoubleMath<n>;

  static constexpr f64 nearZero = 0.75;

  /// erf(x) - x for |x| <= nearZero.
  static D erfRest(D x) { // [2^-56]
    constexpr f64 c[] = {0x1.06eba8214db69p-3,   -0x1.812746b037a0ep-2,
                         0x1.ce2f21a04440cp-4,   -0x1.b82ce312ea842p-6,
                         0x1.565bcd1a959bbp-8,   -0x1.c02db57705320p-11,
                         0x1.f9a3308522a62p-14,  -0x1.f4cf488ac9effp-17,
                         0x1.b97a5fa4a1f19p-20,  -0x1.58fde8519cffap-23,
                         0x1.98d5cb110f6f6p-27};
    return x * polynomialOfPairs(x * x, c);
  }

  /// erfc(a) for a >= nearZero.
  static D erfcPositive(D a) { // [2^-59]
    constexpr f64 c[] = {-0x1.1df1ad154a28dp-3, 0x1.f7f5df66fd783p-7,
                         0x1.16ecefcfa5218p-4, -0x1.9ddb23c3e8e01p-4,
                         0x1.7fee004e168e0p-4, -0x1.0fb06dfe4f78fp-4,
                         0x1.3079edf5d06bbp-5, -0x1.0962388365555p-6,
                         0x1.49c672c753108p-8, -0x1.8d4a9bfed3e94p-11,
                         -0x1.a1df5f2eda2e0p-13, 0x1.3be0711eb9210p-13,
                         -0x1.9951277b48d1fp-16, -0x1.78919582c6503p-17,
                         0x1.7ecaf43dd8559p-18, 0x1.3db587b9a0d3fp-22,
                         -0x1.b5b61d5f10be5p-21, 0x1.2f0af64158d62p-24,
                         0x1.aa16d0dba9433p-24, -0x1.d5c4696982a40p-27,
                         -0x1.126b0fe428dcbp-27};
    constexpr f64 middle = 0x1.3ba5916e9fd7fp+0;
    constexpr f64 middleLow = -0x1.aa9c415679e6fp-55;
    a = limit(a, nearZero, 28.0);
    D q = (a - 4.0) / (a + 4.0);
    D rest = q * polynomialOfPairs(q, c), p = middle + rest;
    D pLow = ((middle - p) + rest) + middleLow;
    D twice = a + a, d = twice + 1.0, dLow = (twice - d) + 1.0;
    D inverse = 1.0 / d, ratio = p * inverse;
    D residual = fma(-ratio, d, p) + fma(-ratio, dLow, pLow);
    D ratioLow = residual * inverse;
    D square = a * a, squareLow = fma(a, a, -square);
    auto e = Math::expParts(-square, -squareLow);
    D first = 1.0 + e.r, low = e.lowOfSum(), sum = first + low;
    low = (first - sum) + low;
    D high = sum * ratio;
    low = fma(sum, ratio, -high) + fma(sum, ratioLow, low * ratio);
    return e.scale(high, low);
  }

  static D erf(D x) {
    D a = abs(x);
    D value = a < nearZero ? a + erfRest(a) : 1.0 - erfcPositive(a);
    return copysign(value, x);
  }

  static D erfc(D x) {
    D a = abs(x), other = erfcPositive(a);
    D small = Math::sum(D(1.0), -x, -erfRest(x));
    return a < nearZero ? small : (x < 0.0 ? 2.0 - other : other);
  }
};

#pragma clang attribute pop

} // namespace

#endif // WARP_DEVICELIB_CPU_DOUBLEERRORS_H

//===- FloatWide.h - Functions of 32-bit floats by way of doubles ---------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Functions that programs call more rarely: they are evaluated in double and
// rounded once more.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_CPU_FLOATWIDE_H
#define WARP_DEVICELIB_CPU_FLOATWIDE_H

#include "DoubleErrors.h"
#include "DoubleInverses.h"

namespace {

#pragma clang attribute push(__attribute__((always_inline)),                  \
                             apply_to = function)

template <int n> struct FloatWide {
  using F = Lanes<f32, n>;
  using D = Lanes<f64, n>;

  static F expm1(F x) { return round(DoubleMath<n>::expm1(convert<D>(x))); }
  static F log1p(F x) { return round(DoubleMath<n>::log1p(convert<D>(x))); }
  static F asinh(F x) { return round(DoubleInverses<n>::asinh(convert<D>(x))); }
  static F acosh(F x) { return round(DoubleInverses<n>::acosh(convert<D>(x))); }
  static F atanh(F x) { return round(DoubleInverses<n>::atanh(convert<D>(x))); }
  static F cbrt(F x) { return round(DoubleInverses<n>::cbrt(convert<D>(x))); }
  static F erf(F x) { return round(DoubleErrors<n>::erf(convert<D>(x))); }
  static F erfc(F x) { return round(DoubleErrors<n>::erfc(convert<D>(x))); }

private:
  static F round(D x) { return convert<F>(x); }
};

#pragma clang attribute pop

} // namespace

#endif // WARP_DEVICELIB_CPU_FLOATWIDE_H

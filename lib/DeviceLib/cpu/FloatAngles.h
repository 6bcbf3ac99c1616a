//===- FloatAngles.h - Angles modulo pi/2, 32 bits ------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// An angle is reduced to [-pi/4, pi/4] by subtracting a multiple of pi/2 that
// is held in three floats: the first product is subtracted exactly, the second
// leaves a rounding error that is kept as a low part. That is enough as long as
// the multiple is small. Larger angles are rare; they are reduced in double,
// lane by lane.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_CPU_FLOATANGLES_H
#define WARP_DEVICELIB_CPU_FLOATANGLES_H

#include "Lanes.h"
#include "../math/LargeAngle.h"

namespace {

[[maybe_unused]] __attribute__((noinline)) ReducedAngle
callReduceLargeAngle(f32 x) {
  return reduceLargeAngle(x);
}

#pragma clang attribute push(__attribute__((always_inline)),                  \
                             apply_to = function)

template <int n> struct FloatAngle {
  using F = Lanes<f32, n>;
  using U = Lanes<u32, n>;

  F high, low; // in [-pi/4, pi/4]
  U quadrant;

  /// For a positive angle. One lane has the rare case inlined, so that a
  /// vectoriser can make a select of the branch.
  explicit FloatAngle(F x) {
    reduceSmall(x);
    auto isLarge = (x > 0x1.0p+17f) & (x < __builtin_inff());
    if (__builtin_expect(!any(isLarge), true))
      return;
    if constexpr (n == 1) {
      ReducedAngle one = reduceLargeAngle(x);
      high = one.high;
      low = one.low;
      quadrant = one.quadrant;
    } else {
#pragma clang loop unroll(disable)
      for (int i = 0; i < n; ++i) {
        if (!laneOf(isLarge, i))
          continue;
        ReducedAngle one = callReduceLargeAngle(laneOf(x, i));
        setLane(high, i, one.high);
        setLane(low, i, one.low);
        setLane(quadrant, i, one.quadrant);
      }
    }
  }

  void reduceSmall(F x) {
    constexpr f32 twoOverPi = 0x1.45f306p-1f, roundToInteger = 0x1.8p+23f;
    constexpr f32 halfPi[] = {0x1.921fb6p+0f, -0x1.777a5cp-25f,
                              -0x1.ee59dap-50f};
    F shifted = fma(x, F(twoOverPi), F(roundToInteger));
    F turns = roundToInteger - shifted;
    F rest = fma(turns, F(halfPi[0]), x);
    F product = turns * halfPi[1];
    F productLow = fma(turns, F(halfPi[1]), -product);
    productLow = fma(turns, F(halfPi[2]), productLow);
    high = rest + product;
    low = ((rest - high) + product) + productLow;
    quadrant = cast<U>(shifted);
  }

  F sin() const { // [2^-28]
    constexpr f32 c[] = {-0x1.555546p-3f, 0x1.110774p-7f, -0x1.9950eep-13f};
    F z = high * high;
    return high + fma(high * z, polynomial(z, c), low);
  }

  F cos() const { // [2^-32]
    constexpr f32 c[] = {0x1.55554ap-5f, -0x1.6c0c2ap-10f, 0x1.99e894p-16f};
    F z = high * high, half = z * 0.5f, near = 1.0f - half;
    F rest = fma(z * z, polynomial(z, c), -(high * low));
    return near + (((1.0f - near) - half) + rest);
  }
};

#pragma clang attribute pop

} // namespace

#endif // WARP_DEVICELIB_CPU_FLOATANGLES_H

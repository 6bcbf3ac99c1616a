//===- Angles.cpp - Sine and cosine for a thread of a GPU -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Sine and cosine of one angle share its reduction to [-pi/4, pi/4], and large
// angles, which are rare, are reduced by a call: kernels stay short. Errors are
// below 1.55 units in the last place.
//
// Polynomials are near the best ones of their degree with float coefficients;
// the error relative to the function is in brackets.
//
//===----------------------------------------------------------------------===//

#include "../math/LargeAngle.h"

namespace {

using Pair = float __attribute__((ext_vector_type(2)));

/// (sine - r) / r^3 [2^-28] and (cosine - 1) / r^2 [2^-32] in r^2, |r| <= pi/4.
constexpr float sineOf[] = {-0x1.555546p-3f, 0x1.110774p-7f, -0x1.9950eep-13f};
constexpr float cosineOf[] = {-0.5f, 0x1.55554ap-5f, -0x1.6c0c2ap-10f,
                              0x1.99e894p-16f};

struct Angle {
  float rest;
  unsigned quadrant;
};

} // namespace

/// For any float; infinities and NaN have no angle.
static __attribute__((noinline, const)) Pair reduceRareAngle(float x) {
  float positive = __builtin_fabsf(x);
  if (!(positive < __builtin_inff()))
    return Pair{x - x, 0.0f};
  ReducedAngle angle = reduceLargeAngle(positive);
  bool negative = x < 0.0f;
  unsigned quadrant = negative ? -angle.quadrant : angle.quadrant;
  return Pair{negative ? -angle.high : angle.high,
              __builtin_bit_cast(float, quadrant & 3)};
}

#pragma clang attribute push(__attribute__((always_inline)),                  \
                             apply_to = function)

/// The multiple of pi/2 has 17 bits at most, and pi/2 is held in three floats, of
/// one sign so that zeros keep theirs.
static inline Angle reduce(float x) {
  constexpr float twoOverPi = 0x1.45f306p-1f, roundToInteger = 0x1.8p+23f;
  float shifted = __builtin_fmaf(x, twoOverPi, roundToInteger);
  float turns = shifted - roundToInteger;
  float rest = __builtin_fmaf(turns, -0x1.921fb4p+0f, x);
  rest = __builtin_fmaf(turns, -0x1.4442d0p-24f, rest);
  rest = __builtin_fmaf(turns, -0x1.84698ap-48f, rest);
  auto quadrant = __builtin_bit_cast(unsigned, shifted);
  if (__builtin_expect(!(__builtin_fabsf(x) <= 0x1.0p+17f), false)) {
    Pair rare = reduceRareAngle(x);
    rest = rare.x;
    quadrant = __builtin_bit_cast(unsigned, float(rare.y));
  }
  return {rest, quadrant};
}

/// The zero that is added keeps the sign of zeros.
static inline float sine(float r) {
  float z = r * r;
  float p = __builtin_fmaf(z, sineOf[2], sineOf[1]);
  p = __builtin_fmaf(z, p, sineOf[0]);
  return __builtin_fmaf(p, __builtin_fmaf(r, z, 0.0f), r);
}

static inline float cosine(float r) {
  float z = r * r;
  float p = __builtin_fmaf(z, cosineOf[3], cosineOf[2]);
  p = __builtin_fmaf(z, p, cosineOf[1]);
  p = __builtin_fmaf(z, p, cosineOf[0]);
  return __builtin_fmaf(z, p, 1.0f);
}

/// The value with its sign changed in quadrants 2 and 3.
static inline float flipped(float x, unsigned quadrant) {
  auto bits = __builtin_bit_cast(unsigned, x);
  return __builtin_bit_cast(float, bits ^ (quadrant << 30 & 0x80000000u));
}

/// Both values are computed: threads of a warp are in any quadrant.
static inline Pair sineAndCosine(Angle a) {
  float s = sine(a.rest), c = cosine(a.rest);
  bool odd = a.quadrant & 1;
  return Pair{flipped(odd ? c : s, a.quadrant),
              flipped(odd ? s : c, a.quadrant + 1)};
}

/// One of the two; the coefficients are chosen, which is less than to compute
/// both.
static inline float sine(float r, unsigned quadrant) {
  bool odd = quadrant & 1;
  float z = r * r, first = odd ? 1.0f : r;
  float p = __builtin_fmaf(z, cosineOf[3], cosineOf[2]);
  p = __builtin_fmaf(z, odd ? p : sineOf[2], odd ? cosineOf[1] : sineOf[1]);
  p = __builtin_fmaf(z, p, odd ? cosineOf[0] : sineOf[0]);
  float value = __builtin_fmaf(p, __builtin_fmaf(z, first, 0.0f), first);
  return quadrant & 2 ? -value : value;
}

extern "C" float warp_gpu_sinf(float x) {
  Angle a = reduce(x);
  return sine(a.rest, a.quadrant);
}

extern "C" float warp_gpu_cosf(float x) {
  Angle a = reduce(x);
  return sine(a.rest, a.quadrant + 1);
}

extern "C" Pair warp_gpu_sincosf(float x) {
  return sineAndCosine(reduce(x));
}

#pragma clang attribute pop

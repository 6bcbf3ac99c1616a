//===- float-math-test.cpp - Accuracy of our functions of floats ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Each function is compared with the C library's double version over all
// binades of float, and at the special operands of IEEE 754-2019, section 9.2.
// The bounds are those of all 2^32 floats, rounded up.
//
//===----------------------------------------------------------------------===//

#include "../../lib/DeviceLib/cpu/FloatMath.h"
#include "../../lib/DeviceLib/cpu/FloatPower.h"
#include "../../lib/DeviceLib/cpu/FloatWide.h"
#include "../../lib/DeviceLib/gpu/Angles.cpp"

#include <cmath>
#include <cstdint>
#include <cstring>
#include <gtest/gtest.h>
#include <random>

namespace {

/// Distance in units in the last place of the float nearest to `reference`.
double ulps(float value, double reference) {
  if (std::isnan(reference) || std::isnan(value))
    return std::isnan(reference) && std::isnan(value) ? 0 : HUGE_VAL;
  float nearest = float(reference);
  if (value == nearest)
    return std::signbit(value) == std::signbit(reference) ? 0 : HUGE_VAL;
  if (std::isinf(value) || std::isinf(nearest))
    return HUGE_VAL;
  int exponent;
  std::frexp(reference, &exponent);
  return std::abs(value - reference) /
         std::ldexp(1.0, std::max(exponent - 24, -149));
}

struct Unary {
  const char *name;
  float (*ours)(float);
  double (*reference)(double);
  double bound;
};

class FloatFunction : public testing::TestWithParam<Unary> {};

// Every 4099th float: 1 M operands from all binades, NaNs and infinities.
TEST_P(FloatFunction, IsWithinItsBound) {
  const Unary &function = GetParam();
  double worst = 0;
  float at = 0;
  for (uint64_t pattern = 0; pattern < (1ull << 32); pattern += 4099) {
    uint32_t bits = uint32_t(pattern);
    float x;
    std::memcpy(&x, &bits, sizeof x);
    double error = ulps(function.ours(x), function.reference(x));
    if (error > worst) {
      worst = error;
      at = x;
    }
  }
  EXPECT_LT(worst, function.bound) << function.name << "(" << at << ")";
}

TEST_P(FloatFunction, IsRightAtSpecialOperands) {
  const Unary &function = GetParam();
  for (float x : {0.0f, -0.0f, 1.0f, -1.0f, INFINITY, -INFINITY, NAN, 1e-45f,
                  -1e-45f, 3.4028235e38f, -3.4028235e38f})
    EXPECT_LT(ulps(function.ours(x), function.reference(x)), function.bound)
        << function.name << "(" << x << ")";
}

INSTANTIATE_TEST_SUITE_P(
    Gpu, FloatFunction,
    testing::Values(Unary{"sin", warp_gpu_sinf, std::sin, 1.55},
                    Unary{"cos", warp_gpu_cosf, std::cos, 1.55}),
    [](const auto &info) { return std::string(info.param.name); });

// Threads that need both get the values that others get.
TEST(FloatFunctionOfGpu, SineAndCosineAreThoseOfOne) {
  for (uint64_t pattern = 0; pattern < (1ull << 32); pattern += 65521) {
    float x = __builtin_bit_cast(float, uint32_t(pattern));
    Pair both = warp_gpu_sincosf(x);
    EXPECT_LT(ulps(both.x, warp_gpu_sinf(x)), 1e-9) << x;
    EXPECT_LT(ulps(both.y, warp_gpu_cosf(x)), 1e-9) << x;
  }
}

#define UNARY(name, bound) Unary{#name, FloatMath<1>::name, std::name, bound}
#define WIDE(name) Unary{#name, FloatWide<1>::name, std::name, 0.502}
INSTANTIATE_TEST_SUITE_P(
    All, FloatFunction,
    testing::Values(UNARY(sin, 0.88), UNARY(cos, 0.88), UNARY(tan, 0.95),
                    UNARY(asin, 0.72), UNARY(acos, 0.69), UNARY(atan, 0.76),
                    UNARY(exp, 0.79), UNARY(exp2, 0.89), UNARY(log, 0.60),
                    UNARY(log2, 0.66), UNARY(log10, 0.64), UNARY(sinh, 0.76),
                    UNARY(cosh, 0.89), UNARY(tanh, 0.96), WIDE(expm1),
                    WIDE(log1p), WIDE(asinh), WIDE(acosh), WIDE(atanh),
                    WIDE(cbrt), WIDE(erf), WIDE(erfc)),
    [](const auto &info) { return std::string(info.param.name); });

constexpr float special[] = {0.0f,   -0.0f,     1.0f,      -1.0f, INFINITY,
                             2.0f,   -INFINITY, NAN,       3.0f,  -3.0f,
                             0.5f,   -0.5f,     1e-45f,    3e38f, -1e-45f,
                             100.0f, 16777215,  33554432.0f};

void compare(float (*ours)(float, float), double (*reference)(double, double),
             float span, double bound) {
  for (float x : special)
    for (float y : special)
      EXPECT_LT(ulps(ours(x, y), reference(x, y)), bound) << x << ", " << y;
  std::mt19937 random(1);
  std::uniform_real_distribution<float> first(0, 50), second(-span, span);
  for (int i = 0; i < 200000; ++i) {
    float x = first(random), y = second(random);
    ASSERT_LT(ulps(ours(x, y), reference(x, y)), bound) << x << ", " << y;
  }
}

TEST(FloatFunctionOfTwo, PowIsWithinHalfAnUlp) {
  compare(FloatPower<1>::pow, std::pow, 20, 0.502);
}

TEST(FloatFunctionOfTwo, Atan2IsWithinItsBound) {
  compare(FloatMath<1>::atan2, std::atan2, 50, 0.85);
}

} // namespace

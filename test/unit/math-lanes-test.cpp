//===- math-lanes-test.cpp - Functions of several lanes -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A kernel's result must not depend on how many of its threads are computed at
// once: functions of a vector have the bits of the one for a single number,
// whatever stands in the other lanes.
//
//===----------------------------------------------------------------------===//

#include "../../lib/DeviceLib/cpu/DoubleArcs.h"
#include "../../lib/DeviceLib/cpu/FloatMath.h"
#include "../../lib/DeviceLib/cpu/FloatPower.h"
#include "../../lib/DeviceLib/cpu/FloatWide.h"

#include <cstring>
#include <gtest/gtest.h>
#include <random>

namespace {

/// The bits, with all NaNs the same.
template <class T> auto bitsOf(T x) {
  using Bits = std::conditional_t<sizeof(T) == 4, uint32_t, uint64_t>;
  if (x != x)
    x = std::numeric_limits<T>::quiet_NaN();
  Bits bits;
  std::memcpy(&bits, &x, sizeof x);
  return bits;
}

/// Any pattern of bits, and as often an ordinary number.
template <class T, class Random> T someNumber(Random &random) {
  uint64_t word = random();
  if (word & 1)
    return T(std::uniform_real_distribution<double>(-8, 8)(random));
  T x;
  std::memcpy(&x, reinterpret_cast<char *>(&word) + 8 - sizeof x, sizeof x);
  return x;
}

template <class T, int lanes, class Function, class One>
void compare(const char *name, Function function, One one) {
  std::mt19937_64 random(7);
  for (int round = 0; round < 200000 / lanes; ++round) {
    Lanes<T, lanes> x, y;
    for (int lane = 0; lane < lanes; ++lane) {
      x[lane] = someNumber<T>(random);
      y[lane] = someNumber<T>(random);
    }
    Lanes<T, lanes> result = function(x, y);
    for (int lane = 0; lane < lanes; ++lane)
      ASSERT_EQ(bitsOf(T(result[lane])), bitsOf(one(x[lane], y[lane])))
          << name << " of " << lanes << " lanes, of " << x[lane] << ", "
          << y[lane];
  }
}

#define COMPARE(type, home, name, lanes)                                       \
  compare<type, lanes>(                                                        \
      #name, [](auto x, auto) { return home<lanes>::name(x); },                \
      [](type x, type) { return home<1>::name(x); })
#define COMPARE_BINARY(type, home, name, lanes)                                \
  compare<type, lanes>(                                                        \
      #name, [](auto x, auto y) { return home<lanes>::name(x, y); },           \
      [](type x, type y) { return home<1>::name(x, y); })
#define FUNCTION(kind, floats, doubles, name)                                  \
  TEST(FloatLanes, name) {                                                     \
    kind(float, floats, name, 4);                                              \
    kind(float, floats, name, 8);                                              \
    kind(float, floats, name, 16);                                             \
  }                                                                            \
  TEST(DoubleLanes, name) {                                                    \
    kind(double, doubles, name, 2);                                            \
    kind(double, doubles, name, 4);                                            \
    kind(double, doubles, name, 8);                                            \
  }

FUNCTION(COMPARE, FloatMath, DoubleMath, sin)
FUNCTION(COMPARE, FloatMath, DoubleMath, cos)
FUNCTION(COMPARE, FloatMath, DoubleMath, tan)
FUNCTION(COMPARE, FloatMath, DoubleArcs, asin)
FUNCTION(COMPARE, FloatMath, DoubleArcs, acos)
FUNCTION(COMPARE, FloatMath, DoubleArcs, atan)
FUNCTION(COMPARE, FloatMath, DoubleMath, exp)
FUNCTION(COMPARE, FloatMath, DoubleMath, exp2)
FUNCTION(COMPARE, FloatMath, DoubleMath, log)
FUNCTION(COMPARE, FloatMath, DoubleMath, log2)
FUNCTION(COMPARE, FloatMath, DoubleMath, log10)
FUNCTION(COMPARE, FloatMath, DoubleMath, sinh)
FUNCTION(COMPARE, FloatMath, DoubleMath, cosh)
FUNCTION(COMPARE, FloatMath, DoubleMath, tanh)
FUNCTION(COMPARE_BINARY, FloatMath, DoubleArcs, atan2)
FUNCTION(COMPARE_BINARY, FloatPower, DoublePower, pow)
FUNCTION(COMPARE, FloatWide, DoubleMath, expm1)
FUNCTION(COMPARE, FloatWide, DoubleMath, log1p)
FUNCTION(COMPARE, FloatWide, DoubleInverses, asinh)
FUNCTION(COMPARE, FloatWide, DoubleInverses, acosh)
FUNCTION(COMPARE, FloatWide, DoubleInverses, atanh)
FUNCTION(COMPARE, FloatWide, DoubleInverses, cbrt)
FUNCTION(COMPARE, FloatWide, DoubleErrors, erf)
FUNCTION(COMPARE, FloatWide, DoubleErrors, erfc)

} // namespace

//===- MathLanesTest.cpp - Functions of several lanes ---------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A kernel's result must not depend on how many of its threads are computed at
// once: functions of 4, 8 and 16 lanes have the bits of the one for a single
// number, whatever stands in the other lanes.
//
//===----------------------------------------------------------------------===//

#include "../../lib/DeviceLib/cpu/FloatMath.h"
#include "../../lib/DeviceLib/cpu/FloatPower.h"

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
#define FLOAT(kind, home, name)                                                \
  TEST(FloatLanes, name) {                                                     \
    kind(float, home, name, 4);                                                \
    kind(float, home, name, 8);                                                \
    kind(float, home, name, 16);                                               \
  }

FLOAT(COMPARE, FloatMath, sin)
FLOAT(COMPARE, FloatMath, cos)
FLOAT(COMPARE, FloatMath, tan)
FLOAT(COMPARE, FloatMath, asin)
FLOAT(COMPARE, FloatMath, acos)
FLOAT(COMPARE, FloatMath, atan)
FLOAT(COMPARE, FloatMath, exp)
FLOAT(COMPARE, FloatMath, exp2)
FLOAT(COMPARE, FloatMath, log)
FLOAT(COMPARE, FloatMath, log2)
FLOAT(COMPARE, FloatMath, log10)
FLOAT(COMPARE, FloatMath, sinh)
FLOAT(COMPARE, FloatMath, cosh)
FLOAT(COMPARE, FloatMath, tanh)
FLOAT(COMPARE_BINARY, FloatMath, atan2)
FLOAT(COMPARE_BINARY, FloatPower, pow)

} // namespace

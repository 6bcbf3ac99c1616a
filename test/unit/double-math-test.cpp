//===- double-math-test.cpp - Accuracy of the CPU's functions of doubles --===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Each function is compared with the C library's version of 64 bits of
// significand, over all binades, where it changes, near its zeros, and at the
// special operands of IEEE 754-2019, section 9.2.
//
//===----------------------------------------------------------------------===//

#include "../../lib/DeviceLib/cpu/DoubleArcs.h"
#include "../../lib/DeviceLib/cpu/DoubleErrors.h"
#include "../../lib/DeviceLib/cpu/DoubleInverses.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <gtest/gtest.h>
#include <random>

namespace {

using Extended = long double;
static_assert(std::numeric_limits<Extended>::digits >= 64);

/// Distance in units in the last place of the double nearest to `reference`.
double ulps(double value, Extended reference) {
  if (std::isnan(reference) || std::isnan(value))
    return std::isnan(reference) && std::isnan(value) ? 0 : HUGE_VAL;
  double nearest = double(reference);
  if (value == nearest && (value == 0 || std::isinf(value)))
    return std::signbit(value) == std::signbit(nearest) ? 0 : HUGE_VAL;
  if (std::isinf(value) || std::isinf(nearest))
    return HUGE_VAL;
  int exponent;
  std::frexp(reference, &exponent);
  return double(std::abs(value - reference) /
                std::ldexp(Extended(1), std::max(exponent - 53, -1074)));
}

class Operands {
public:
  double any() {
    uint64_t bits = random();
    double x;
    std::memcpy(&x, &bits, sizeof x);
    return x;
  }
  double within(double span) {
    return std::uniform_real_distribution<double>(-span, span)(random);
  }
  /// Close to zero or to a number.
  double near(double x) {
    return x + std::ldexp(within(1), -int(random() % 50));
  }
  /// Close to a zero of a function of angles.
  double angle() { return std::rint(within(1e6)) * 1.5707963267948966; }

private:
  std::mt19937_64 random{5};
};

constexpr double special[] = {
    0.0,        -0.0,    1.0,     -1.0,    0.5,     -0.5,    2.0,
    INFINITY,   3.0,     -3.0,    5e-324,  1e300,   1e-310,  -1e-310,
    -INFINITY,  NAN,     709.78,  710.0,   -745.13, -746.0,  1023.9999,
    1024.0,     -1074.0, -1075.1, 711.0,   1e22,    0x1p27,  9007199254740993.0,
    -5e-324,    100.0,   1e-20,   0x1.6ac5b262ca1ffp+849};

struct Unary {
  const char *name;
  double (*ours)(double);
  Extended (*reference)(Extended);
  /// The range of most operands.
  double span;
};

class DoubleFunction : public testing::TestWithParam<Unary> {};

TEST_P(DoubleFunction, IsWithinOneUlp) {
  const Unary &function = GetParam();
  auto check = [&](double x) {
    ASSERT_LT(ulps(function.ours(x), function.reference(x)), 0.95)
        << function.name << "(" << x << ")";
  };
  for (double x : special)
    check(x);
  Operands operands;
  for (int i = 0; i < 40000; ++i) {
    check(operands.any());
    check(operands.within(function.span));
    check(operands.near(0));
    check(operands.near(1));
    check(operands.angle());
  }
}

#define UNARY(name, span) UNARY_OF(DoubleMath, name, span)
#define ARC(name, span) UNARY_OF(DoubleArcs, name, span)
#define INVERSE(name, span) UNARY_OF(DoubleInverses, name, span)
#define ERROR(name, span) UNARY_OF(DoubleErrors, name, span)
#define UNARY_OF(home, name, span)                                             \
  Unary { #name, home<1>::name, ::name##l, span }
INSTANTIATE_TEST_SUITE_P(
    All, DoubleFunction,
    testing::Values(UNARY(sin, 100), UNARY(cos, 100), UNARY(tan, 100),
                    ARC(asin, 1), ARC(acos, 1), ARC(atan, 10),
                    UNARY(exp, 750), UNARY(exp2, 1100), UNARY(log, 1e5),
                    UNARY(log2, 10), UNARY(log10, 10), UNARY(sinh, 720),
                    UNARY(cosh, 720), UNARY(tanh, 5), UNARY(expm1, 50),
                    UNARY(log1p, 10), INVERSE(asinh, 100),
                    INVERSE(acosh, 100), INVERSE(atanh, 1),
                    INVERSE(cbrt, 1000), ERROR(erf, 3), ERROR(erfc, 27)),
    [](const auto &info) { return std::string(info.param.name); });

template <class Ours, class Reference>
void compare(Ours ours, Reference reference, auto operand) {
  auto check = [&](double x, double y) {
    ASSERT_LT(ulps(ours(x, y), reference(x, y)), 0.95) << x << ", " << y;
  };
  for (double x : special)
    for (double y : special)
      check(x, y);
  Operands operands;
  for (int i = 0; i < 100000; ++i) {
    check(operands.any(), operands.any());
    double x = std::abs(i % 2 ? operands.near(1) : operands.any());
    check(x, operand(operands, x));
  }
}

TEST(DoubleFunctionOfTwo, PowIsWithinOneUlp) {
  // Exponents that lead to every binade of results.
  auto exponent = [](Operands &operands, double x) {
    return operands.within(1076) / std::log2(x);
  };
  compare(DoublePower<1>::pow, ::powl, exponent);
}

TEST(DoubleFunctionOfTwo, Atan2IsWithinOneUlp) {
  auto other = [](Operands &operands, double x) {
    return x * operands.within(4);
  };
  compare(DoubleArcs<1>::atan2, ::atan2l, other);
}

} // namespace

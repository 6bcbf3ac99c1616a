//===- autodiff-test.cpp - Derivatives from C++, without Python -----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "warp/Array.h"
#include "warp/Autodiff.h"
#include "warp/Runtime.h"

#include <gtest/gtest.h>
#include <numeric>
#include <vector>

using namespace warp;

/// y[i] = s x[i]^2
static const char *const squareText = R"(
module @square {
  func.func @square(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %s: f32)
      attributes {warp.arg_names = ["x", "y", "s"], warp.kernel} {
    %i = warp.tid : si32
    %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
    %w = warp.mul(%v, %v) : (f32, f32) -> f32
    %z = warp.mul(%s, %w) : (f32, f32) -> f32
    warp.store %z, %y[%i] : f32, !warp.array<1 x f32>, si32
    return
  }
})";

namespace {

/// A view with a gradient.
ArrayArgument<float> argument(std::vector<float> &data,
                              std::vector<float> &grad) {
  return view(data.data(), {int64_t(data.size())}, {}, grad.data());
}

} // namespace

TEST(Autodiff, AdjointAddsToGradientsAndTakesThoseOfResults) {
  Derivative adjoint = differentiate(Module::fromText(squareText));
  EXPECT_TRUE(adjoint.hidden.empty());
  EXPECT_EQ(adjoint.needed, std::vector<int>{0});
  EXPECT_TRUE(adjoint.oneThread.empty());
  Kernel kernel(adjoint.module, "square_adjoint");
  const int64_t n = 1000;
  std::vector<float> x(n), y(n), gx(n, 1), gy(n, 1);
  std::iota(x.begin(), x.end(), 0.0f);
  launch(kernel, cpuDevice, {n}, argument(x, gx), argument(y, gy), 3.0f);
  for (int64_t i = 0; i < n; ++i) {
    EXPECT_EQ(gx[i], 1 + 6 * x[i]);
    EXPECT_EQ(gy[i], 0);
    EXPECT_EQ(y[i], 0);
  }
}

TEST(Autodiff, TangentComputesBoth) {
  AutodiffOptions options;
  options.forward = true;
  Derivative tangent = differentiate(Module::fromText(squareText), options);
  ASSERT_EQ(tangent.hidden.size(), 2u);
  EXPECT_EQ(tangent.hidden[0].kind, HiddenArgument::Kind::Tangent);
  Kernel kernel(tangent.module, "square_tangent");
  std::vector<float> x{1, 2, 3}, y(3), dx{1, 10, 100}, dy(3);
  launch(kernel, cpuDevice, {3}, view(x.data(), {3}), view(y.data(), {3}), 2.0f,
         view(dx.data(), {3}), view(dy.data(), {3}));
  EXPECT_EQ(y, (std::vector<float>{2, 8, 18}));
  EXPECT_EQ(dy, (std::vector<float>{4, 80, 1200}));
}

TEST(Autodiff, InactiveArraysCostNothing) {
  AutodiffOptions options;
  options.active = {false, true};
  Derivative adjoint = differentiate(Module::fromText(squareText), options);
  EXPECT_TRUE(adjoint.needed.empty());
  EXPECT_EQ(adjoint.module.text().find("warp.accumulate"), std::string::npos);
}

TEST(Autodiff, PrimalStaysAsItIs) {
  Module primal = Module::fromText(squareText);
  std::string before = fingerprint(primal, {});
  Derivative adjoint = differentiate(primal);
  EXPECT_EQ(fingerprint(primal, {}), before);
  EXPECT_NE(fingerprint(adjoint.module, {}), before);
  EXPECT_EQ(fingerprint(differentiate(primal).module, {}),
            fingerprint(adjoint.module, {}));
}

TEST(Autodiff, WrongOptionsAreErrors) {
  Module primal = Module::fromText(squareText);
  auto messageFor = [&](const AutodiffOptions &options) -> std::string {
    try {
      differentiate(primal, options);
    } catch (const Error &error) {
      return error.what();
    }
    return "";
  };
  AutodiffOptions flags, policy;
  flags.active = {true};
  EXPECT_EQ(messageFor(flags),
            "expects 2 flags for the arrays of the kernel, but got 1");
  policy.singular = "zero";
  EXPECT_EQ(messageFor(policy),
            "expects 'pinned', 'strict', 'report' or 'repeated' at singular "
            "points, but got 'zero'");
}

TEST(Autodiff, WhatHasNoDerivativeIsAnErrorAtItsLine) {
  const char *text = R"(
module @k {
  func.func @k(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
      attributes {warp.arg_names = ["x", "y"], warp.kernel} {
    %i = warp.tid : si32
    %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
    %o = warp.atomic exch %v, %y[%i] : f32, !warp.array<1 x f32>, si32 -> f32
    return
  }
})";
  try {
    differentiate(Module::fromText(text));
    FAIL() << "expects an error";
  } catch (const Error &error) {
    EXPECT_EQ(error.kind, Error::Kind::Compile);
    EXPECT_EQ(error.line, 7);
  }
}

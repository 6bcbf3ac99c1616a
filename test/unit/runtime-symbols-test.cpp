//===- runtime-symbols-test.cpp - Conversions of small floats -------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Support/RuntimeSymbols.h"

#include "llvm/ADT/APFloat.h"

#include <gtest/gtest.h>

#include <bit>
#include <random>

using llvm::APFloat;

namespace {

uint64_t bitsOf(APFloat value, const llvm::fltSemantics &format) {
  bool losesInfo;
  value.convert(format, APFloat::rmNearestTiesToEven, &losesInfo);
  return value.bitcastToAPInt().getZExtValue();
}

// Every half has the value that LLVM gives it.
TEST(RuntimeSymbols, HalfValue) {
  for (unsigned bits = 0; bits < 65536; ++bits) {
    APFloat half(APFloat::IEEEhalf(), llvm::APInt(16, bits));
    EXPECT_EQ(std::bit_cast<uint32_t>(warp::halfValue(bits)),
              bitsOf(half, APFloat::IEEEsingle()))
        << bits;
  }
}

// Doubles of all kinds, those halfway between two values and their neighbours
// among them, round as LLVM rounds them.
TEST(RuntimeSymbols, RoundsToNearest) {
  std::mt19937_64 random(7);
  auto check = [](uint64_t bits) {
    double value = std::bit_cast<double>(bits);
    ASSERT_EQ(warp::halfBits(value),
              bitsOf(APFloat(value), APFloat::IEEEhalf()))
        << bits;
    ASSERT_EQ(warp::bfloatBits(value),
              bitsOf(APFloat(value), APFloat::BFloat()))
        << bits;
  };
  for (int i = 0; i < 200000; ++i) {
    uint64_t bits = random();
    check(bits);
    // Within the range of a half and around, with few bits of mantissa.
    uint64_t exponent = 1023 - 30 + random() % 60;
    uint64_t near =
        (bits & 1ull << 63) | exponent << 52 | (bits & 0xfff8000000000ull);
    check(near);
    check(near + 1);
    check(near - 1);
    uint64_t small =
        (1023 - 140 + random() % 20) << 52 | (bits & 0xfff0000000000ull);
    check(small);
  }
  for (double value : {0.0, -0.0, 65504.0, 65519.99, 65520.0, 0x1p-24, 0x1p-25,
                       0x1.8p-25, 1e308, 5e-324})
    check(std::bit_cast<uint64_t>(value));
}

} // namespace

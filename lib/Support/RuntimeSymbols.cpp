//===- RuntimeSymbols.cpp - Functions that code for CPUs may call ---------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "RuntimeSymbols.h"

#include "LibmNames.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>

// The runtime's; a tool that does not link the runtime has none.
extern "C" __attribute__((weak)) int warp_printf(const char *format, ...);

//===----------------------------------------------------------------------===//
// Conversions of small floats
//===----------------------------------------------------------------------===//

/// Rounds to a format of 16 bits that has so many bits of mantissa.
static uint16_t roundTo(double value, int mantissaBits) {
  uint64_t bits = 0;
  std::memcpy(&bits, &value, sizeof bits);
  uint16_t sign = bits >> 63 << 15;
  int exponent = bits >> 52 & 0x7ff, shift = 52 - mantissaBits;
  uint64_t mantissa = bits & ((uint64_t(1) << 52) - 1);
  uint16_t infinity = 0x8000 - (1 << mantissaBits);
  if (exponent == 0x7ff)
    return sign | infinity | uint16_t(mantissa >> shift) |
           (mantissa ? 1 << (mantissaBits - 1) : 0);
  // The exponent of the least normal number.
  int least = 1024 - (infinity >> mantissaBits) / 2;
  int above = exponent - least;
  mantissa |= uint64_t(exponent != 0) << 52;
  uint32_t result = 0;
  if (above >= 0)
    result = uint32_t(std::min(above, 0xffff)) << mantissaBits;
  else
    shift -= above;
  if (shift > 54)
    return sign;
  uint64_t kept = mantissa >> shift, half = uint64_t(1) << (shift - 1);
  uint64_t rest = mantissa & (2 * half - 1);
  result += kept + (rest > half || (rest == half && (kept & 1)));
  return sign | uint16_t(std::min<uint32_t>(result, infinity));
}

uint16_t warp::halfBits(double value) { return roundTo(value, 10); }
uint16_t warp::bfloatBits(double value) { return roundTo(value, 7); }

float warp::halfValue(uint16_t bits) {
  int exponent = bits >> 10 & 31;
  uint32_t mantissa = bits & 0x3ff, sign = uint32_t(bits & 0x8000) << 16;
  if (exponent == 0) {
    float value = std::ldexp(float(mantissa), -24);
    return sign ? -value : value;
  }
  uint32_t wide = sign | mantissa << 13;
  wide |= exponent == 31 ? 0x7f800000 | (mantissa ? 0x400000 : 0)
                         : uint32_t(exponent + 112) << 23;
  float value = 0;
  std::memcpy(&value, &wide, sizeof value);
  return value;
}

// On x86-64 a half or bfloat travels in the low bits of an SSE register, so as
// far as callers see these functions take and return `_Float16`.

template <typename To, typename From> static To bitsAs(From from) {
  static_assert(sizeof(To) == sizeof(From));
  To to;
  std::memcpy(&to, &from, sizeof to);
  return to;
}

static float halfToFloat(_Float16 x) {
  return warp::halfValue(bitsAs<uint16_t>(x));
}
static _Float16 floatToHalf(float x) {
  return bitsAs<_Float16>(warp::halfBits(x));
}
static _Float16 doubleToHalf(double x) {
  return bitsAs<_Float16>(warp::halfBits(x));
}
static _Float16 floatToBFloat(float x) {
  return bitsAs<_Float16>(warp::bfloatBits(x));
}
static _Float16 doubleToBFloat(double x) {
  return bitsAs<_Float16>(warp::bfloatBits(x));
}

//===----------------------------------------------------------------------===//
// Symbols
//===----------------------------------------------------------------------===//

template <typename Result, typename... Args>
static void *addressOf(Result (*function)(Args...)) {
  return reinterpret_cast<void *>(function);
}

using Float1 = float (*)(float);
using Float2 = float (*)(float, float);
using Double1 = double (*)(double);
using Double2 = double (*)(double, double);

std::vector<warp::RuntimeSymbol> warp::runtimeSymbols() {
  std::vector<RuntimeSymbol> symbols;
  auto add = [&](const char *name, auto function) {
    symbols.push_back({name, addressOf(function)});
  };
#define UNARY(name)                                                            \
  add(#name "f", static_cast<Float1>(::name##f));                              \
  add(#name, static_cast<Double1>(::name));
#define BINARY(name)                                                           \
  add(#name "f", static_cast<Float2>(::name##f));                              \
  add(#name, static_cast<Double2>(::name));
  UNARY(sqrt)
  UNARY(floor)
  UNARY(ceil)
  UNARY(trunc)
  UNARY(round)
  UNARY(rint)
  UNARY(nearbyint)
  BINARY(fmod) BINARY(fmin) BINARY(fmax) BINARY(copysign)
#undef UNARY
#undef BINARY
#define UNARY(name)                                                            \
  add("warp_libm_" #name "f", static_cast<Float1>(::name##f));                 \
  add("warp_libm_" #name, static_cast<Double1>(::name));
#define BINARY(name)                                                           \
  add("warp_libm_" #name "f", static_cast<Float2>(::name##f));                 \
  add("warp_libm_" #name, static_cast<Double2>(::name));
#define MEMORY(name) add("warp_libm_" #name, &::name);
      WARP_LIBM_UNARY(UNARY) WARP_LIBM_BINARY(BINARY) WARP_LIBC_MEMORY(MEMORY)
#undef UNARY
#undef BINARY
#undef MEMORY
          add("roundevenf", static_cast<Float1>(::rintf));
  add("roundeven", static_cast<Double1>(::rint));
  add("fmaf", static_cast<float (*)(float, float, float)>(::fmaf));
  add("fma", static_cast<double (*)(double, double, double)>(::fma));
  add("ldexpf", static_cast<float (*)(float, int)>(::ldexpf));
  add("ldexp", static_cast<double (*)(double, int)>(::ldexp));
  add("memcpy", &std::memcpy);
  add("memmove", &std::memmove);
  add("memset", &std::memset);
  add("__extendhfsf2", &halfToFloat);
  add("__truncsfhf2", &floatToHalf);
  add("__truncdfhf2", &doubleToHalf);
  add("__truncsfbf2", &floatToBFloat);
  add("__truncdfbf2", &doubleToBFloat);
  symbols.push_back({"warp_printf", reinterpret_cast<void *>(&warp_printf)});
  return symbols;
}

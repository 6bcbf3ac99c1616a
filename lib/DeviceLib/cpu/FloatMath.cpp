//===- FloatMath.cpp - Elementary functions of 32-bit floats --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The elementary functions that a CPU kernel calls, for one thread
// (`warp_sinf`) or for a vector of them (`warp_sinf_x16`). They are linked into
// the kernel as bitcode and inlined, so they are written for what the kernel's
// processor has: vector arithmetic that LLVM knows, no branch but for what is
// rare.
//
//===----------------------------------------------------------------------===//

#include "FloatMath.h"
#include "FloatPower.h"

#define WARP_UNARY(type, symbol, function, lanes)                              \
  extern "C" __attribute__((always_inline, used)) Lanes<type, lanes> symbol(   \
      Lanes<type, lanes> x) {                                                  \
    return function(x);                                                        \
  }
#define WARP_BINARY(type, symbol, function, lanes)                             \
  extern "C" __attribute__((always_inline, used)) Lanes<type, lanes> symbol(   \
      Lanes<type, lanes> x, Lanes<type, lanes> y) {                            \
    return function(x, y);                                                     \
  }

#define WARP_FLOAT(kind, home, name)                                           \
  kind(f32, warp_##name##f, home<1>::name, 1)                                  \
  kind(f32, warp_##name##f_x4, home<4>::name, 4)                               \
  kind(f32, warp_##name##f_x8, home<8>::name, 8)                               \
  kind(f32, warp_##name##f_x16, home<16>::name, 16)

WARP_FLOAT(WARP_UNARY, FloatMath, sin)
WARP_FLOAT(WARP_UNARY, FloatMath, cos)
WARP_FLOAT(WARP_UNARY, FloatMath, tan)
WARP_FLOAT(WARP_UNARY, FloatMath, asin)
WARP_FLOAT(WARP_UNARY, FloatMath, acos)
WARP_FLOAT(WARP_UNARY, FloatMath, atan)
WARP_FLOAT(WARP_BINARY, FloatMath, atan2)
WARP_FLOAT(WARP_UNARY, FloatMath, exp)
WARP_FLOAT(WARP_UNARY, FloatMath, exp2)
WARP_FLOAT(WARP_UNARY, FloatMath, log)
WARP_FLOAT(WARP_UNARY, FloatMath, log2)
WARP_FLOAT(WARP_UNARY, FloatMath, log10)
WARP_FLOAT(WARP_UNARY, FloatMath, sinh)
WARP_FLOAT(WARP_UNARY, FloatMath, cosh)
WARP_FLOAT(WARP_UNARY, FloatMath, tanh)
WARP_FLOAT(WARP_BINARY, FloatPower, pow)

//===- MathFunctions.cpp - Elementary functions of the CPU ----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The elementary functions that a CPU kernel calls, for one thread
// (`warp_sinf`, `warp_sin`) or for a vector of 128, 256 or 512 bits of them
// (`warp_sinf_x16`, `warp_sin_x8`). They are linked into the kernel as bitcode
// and inlined, so they are written for what the kernel's processor has: vector
// arithmetic that LLVM knows, no branch but for what is rare. What is listed
// here is `ours` in LowerMath.cpp.
//
//===----------------------------------------------------------------------===//

#include "DoublePower.h"
#include "FloatMath.h"
#include "FloatPower.h"

#define UNARY(symbol, function, type)                                          \
  extern "C" __attribute__((always_inline, used)) type symbol(type x) {        \
    return function(x);                                                        \
  }
#define BINARY(symbol, function, type)                                         \
  extern "C" __attribute__((always_inline, used)) type symbol(type x,          \
                                                              type y) {        \
    return function(x, y);                                                     \
  }
#define COMMA ,
#define FUNCTION(kind, home, name)                                             \
  kind(warp_##name##f, Float##home<1>::name, f32)                              \
  kind(warp_##name##f_x4, Float##home<4>::name, Lanes<f32 COMMA 4>)            \
  kind(warp_##name##f_x8, Float##home<8>::name, Lanes<f32 COMMA 8>)            \
  kind(warp_##name##f_x16, Float##home<16>::name, Lanes<f32 COMMA 16>)         \
  kind(warp_##name, Double##home<1>::name, f64)                                \
  kind(warp_##name##_x2, Double##home<2>::name, Lanes<f64 COMMA 2>)            \
  kind(warp_##name##_x4, Double##home<4>::name, Lanes<f64 COMMA 4>)            \
  kind(warp_##name##_x8, Double##home<8>::name, Lanes<f64 COMMA 8>)

FUNCTION(UNARY, Math, sin)
FUNCTION(UNARY, Math, cos)
FUNCTION(UNARY, Math, tan)
FUNCTION(UNARY, Math, asin)
FUNCTION(UNARY, Math, acos)
FUNCTION(UNARY, Math, atan)
FUNCTION(BINARY, Math, atan2)
FUNCTION(UNARY, Math, exp)
FUNCTION(UNARY, Math, exp2)
FUNCTION(UNARY, Math, log)
FUNCTION(UNARY, Math, log2)
FUNCTION(UNARY, Math, log10)
FUNCTION(UNARY, Math, sinh)
FUNCTION(UNARY, Math, cosh)
FUNCTION(UNARY, Math, tanh)
FUNCTION(BINARY, Power, pow)

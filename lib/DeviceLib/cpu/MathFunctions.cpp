//===- MathFunctions.cpp - Elementary functions of the CPU ----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The elementary functions that a CPU kernel calls, for one thread
// (`warp_sinf`, `warp_sin`) or for a vector of 128, 256 or 512 bits of them
// (`warp_sinf_x16`, `warp_sin_x8`). They are linked into the kernel as bitcode
// and inlined, so they are written for what the kernel's processor has: vector
// arithmetic that LLVM knows, no branch but for what is rare. LowerMath.cpp
// has the same list.
//
//===----------------------------------------------------------------------===//

#include "DoubleArcs.h"
#include "DoubleErrors.h"
#include "DoubleInverses.h"
#include "DoublePower.h"
#include "FloatMath.h"
#include "FloatPower.h"
#include "FloatWide.h"

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
#define FUNCTION(kind, floats, doubles, name)                                  \
  kind(warp_##name##f, floats<1>::name, f32)                                   \
  kind(warp_##name##f_x4, floats<4>::name, Lanes<f32 COMMA 4>)                 \
  kind(warp_##name##f_x8, floats<8>::name, Lanes<f32 COMMA 8>)                 \
  kind(warp_##name##f_x16, floats<16>::name, Lanes<f32 COMMA 16>)              \
  kind(warp_##name, doubles<1>::name, f64)                                     \
  kind(warp_##name##_x2, doubles<2>::name, Lanes<f64 COMMA 2>)                 \
  kind(warp_##name##_x4, doubles<4>::name, Lanes<f64 COMMA 4>)                 \
  kind(warp_##name##_x8, doubles<8>::name, Lanes<f64 COMMA 8>)

FUNCTION(UNARY, FloatMath, DoubleMath, sin)
FUNCTION(UNARY, FloatMath, DoubleMath, cos)
FUNCTION(UNARY, FloatMath, DoubleMath, tan)
FUNCTION(UNARY, FloatMath, DoubleArcs, asin)
FUNCTION(UNARY, FloatMath, DoubleArcs, acos)
FUNCTION(UNARY, FloatMath, DoubleArcs, atan)
FUNCTION(BINARY, FloatMath, DoubleArcs, atan2)
FUNCTION(UNARY, FloatMath, DoubleMath, exp)
FUNCTION(UNARY, FloatMath, DoubleMath, exp2)
FUNCTION(UNARY, FloatMath, DoubleMath, log)
FUNCTION(UNARY, FloatMath, DoubleMath, log2)
FUNCTION(UNARY, FloatMath, DoubleMath, log10)
FUNCTION(UNARY, FloatMath, DoubleMath, sinh)
FUNCTION(UNARY, FloatMath, DoubleMath, cosh)
FUNCTION(UNARY, FloatMath, DoubleMath, tanh)
FUNCTION(BINARY, FloatPower, DoublePower, pow)
FUNCTION(UNARY, FloatWide, DoubleMath, expm1)
FUNCTION(UNARY, FloatWide, DoubleMath, log1p)
FUNCTION(UNARY, FloatWide, DoubleInverses, asinh)
FUNCTION(UNARY, FloatWide, DoubleInverses, acosh)
FUNCTION(UNARY, FloatWide, DoubleInverses, atanh)
FUNCTION(UNARY, FloatWide, DoubleInverses, cbrt)
FUNCTION(UNARY, FloatWide, DoubleErrors, erf)
FUNCTION(UNARY, FloatWide, DoubleErrors, erfc)

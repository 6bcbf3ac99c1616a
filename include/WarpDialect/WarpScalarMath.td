//===- WarpScalarMath.td - Functions of scalars --------------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_SCALAR_MATH_TD
#define WARP_SCALAR_MATH_TD

include "WarpBuiltinBase.td"

class Warp_ScalarMath<string mnemonic, list<string> overloads, string summaryOf,
                      Lowering lowering = ByFunction>
    : Warp_Builtin<mnemonic, "Scalar math", overloads, summaryOf, lowering>;

/// Function of one float.
class Warp_FloatFunction<string mnemonic, string summaryOf, string interval,
                         Lowering lowering = ByFunction>
    : Warp_ScalarMath<mnemonic, ["(x: F) -> F"], summaryOf, lowering> {
  let domain = [interval];
}
class Warp_Rounding<string mnemonic, string summaryOf,
                    Lowering lowering = ByFunction>
    : Warp_FloatFunction<mnemonic, summaryOf, "[-1e5, 1e5]", lowering> {
  let derivative = PiecewiseConstant;
}

def Warp_SinOp : Warp_FloatFunction<"sin", "sine of an angle in radians",
    "[-100, 100]", Elementwise<"math::SinOp">>;
def Warp_CosOp : Warp_FloatFunction<"cos", "cosine of an angle in radians",
    "[-100, 100]", Elementwise<"math::CosOp">>;
def Warp_TanOp : Warp_FloatFunction<"tan", "tangent of an angle in radians",
    "[-1.5, 1.5]", Elementwise<"math::TanOp">>;
def Warp_AsinOp : Warp_FloatFunction<"asin",
    "arc sine in radians; the operand is clamped to [-1, 1]", "[-1, 1]">;
def Warp_AcosOp : Warp_FloatFunction<"acos",
    "arc cosine in radians; the operand is clamped to [-1, 1]", "[-1, 1]">;
def Warp_AtanOp : Warp_FloatFunction<"atan", "arc tangent in radians",
    "[-100, 100]", Elementwise<"math::AtanOp">>;
def Warp_SinhOp : Warp_FloatFunction<"sinh", "hyperbolic sine", "[-10, 10]",
    Elementwise<"math::SinhOp">>;
def Warp_CoshOp : Warp_FloatFunction<"cosh", "hyperbolic cosine", "[-10, 10]",
    Elementwise<"math::CoshOp">>;
def Warp_TanhOp : Warp_FloatFunction<"tanh", "hyperbolic tangent", "[-10, 10]",
    Elementwise<"math::TanhOp">>;
def Warp_DegreesOp : Warp_FloatFunction<"degrees", "radians to degrees",
    "[-10, 10]">;
def Warp_RadiansOp : Warp_FloatFunction<"radians", "degrees to radians",
    "[-500, 500]">;
def Warp_ExpOp : Warp_FloatFunction<"exp", "exponential", "[-10, 10]",
    Elementwise<"math::ExpOp">>;
def Warp_LogOp : Warp_FloatFunction<"log", "natural logarithm", "[1e-4, 100]",
    Elementwise<"math::LogOp">>;
def Warp_Log2Op : Warp_FloatFunction<"log2", "logarithm to base 2",
    "[1e-4, 100]", Elementwise<"math::Log2Op">>;
def Warp_Log10Op : Warp_FloatFunction<"log10", "logarithm to base 10",
    "[1e-4, 100]", Elementwise<"math::Log10Op">>;
def Warp_SqrtOp : Warp_FloatFunction<"sqrt", "square root", "[0, 100]",
    Elementwise<"math::SqrtOp">>;
def Warp_CbrtOp : Warp_FloatFunction<"cbrt", "cube root", "[-100, 100]",
    Elementwise<"math::CbrtOp">>;
def Warp_ErfOp : Warp_FloatFunction<"erf", "error function", "[-3, 3]",
    Elementwise<"math::ErfOp">>;
def Warp_ErfcOp : Warp_FloatFunction<"erfc", "complement of the error function",
    "[-3, 3]", Elementwise<"math::ErfcOp">>;
def Warp_ErfInvOp : Warp_FloatFunction<"erfinv",
    "inverse of the error function", "[-0.99, 0.99]">;
def Warp_ErfcInvOp : Warp_FloatFunction<"erfcinv",
    "inverse of the complement of the error function", "[0.01, 1.99]">;

def Warp_RoundOp : Warp_Rounding<"round",
    "nearest integer, half away from zero", Elementwise<"math::RoundOp">>;
def Warp_RintOp : Warp_Rounding<"rint", "nearest integer, half to even",
    Elementwise<"math::RoundEvenOp">>;
def Warp_TruncOp : Warp_Rounding<"trunc", "integer part, toward zero",
    Elementwise<"math::TruncOp">>;
def Warp_FloorOp : Warp_Rounding<"floor", "largest integer not above",
    Elementwise<"math::FloorOp">>;
def Warp_CeilOp : Warp_Rounding<"ceil", "smallest integer not below",
    Elementwise<"math::CeilOp">>;
def Warp_FracOp : Warp_FloatFunction<"frac",
    "fraction that remains of x after trunc(x)", "[-100, 100]">;

def Warp_Atan2Op : Warp_ScalarMath<"atan2", ["(y: F, x: F) -> F"],
    "angle of the point (x, y) in radians", Elementwise<"math::Atan2Op">> {
  let domain = ["[-10, 10]", "[-10, 10]"];
}
def Warp_PowOp : Warp_ScalarMath<"pow", ["(x: F, y: F) -> F"],
    "x to the power y", Elementwise<"math::PowFOp">> {
  let domain = ["[0.01, 10]", "[-3, 3]"];
}
def Warp_CopysignOp : Warp_ScalarMath<"copysign", ["(x: F, y: F) -> F"],
    "magnitude of x with the sign of y", Elementwise<"math::CopySignOp">> {
  let domain = ["[-10, 10]", "[-10, 10]"];
}

defvar AbsOverloads = ["(x: S) -> S", "(x: vec<n,S>) -> vec<n,S>"];
def Warp_AbsOp : Warp_ScalarMath<"abs", AbsOverloads,
    "absolute value, by component">;
def Warp_SignOp : Warp_ScalarMath<"sign", AbsOverloads,
    "-1 for negative values, otherwise 1, by component"> {
  let derivative = PiecewiseConstant;
}
def Warp_StepOp : Warp_ScalarMath<"step", ["(x: S) -> S"],
    "1 for negative values, otherwise 0"> {
  let derivative = PiecewiseConstant;
}
def Warp_NonzeroOp : Warp_ScalarMath<"nonzero", ["(x: S) -> S"],
    "0 for zero, otherwise 1"> {
  let derivative = PiecewiseConstant;
}
def Warp_MinOp : Warp_ScalarMath<"min", ["(a: S, b: S) -> S",
    "(a: vec<n,S>, b: vec<n,S>) -> vec<n,S>", "(a: vec<n,S>) -> S"],
    "smaller value, by component; of one vector, its smallest component. A NaN "
    "counts as missing">;
def Warp_MaxOp : Warp_ScalarMath<"max", ["(a: S, b: S) -> S",
    "(a: vec<n,S>, b: vec<n,S>) -> vec<n,S>", "(a: vec<n,S>) -> S"],
    "larger value, by component; of one vector, its largest component. A NaN "
    "counts as missing">;
def Warp_ClampOp : Warp_ScalarMath<"clamp", ["(x: S, low: S, high: S) -> S"],
    "x limited to [low, high]">;
def Warp_LerpOp : Warp_ScalarMath<"lerp", ["(a: F, b: F, t: F) -> F",
    "(a: vec<n,F>, b: vec<n,F>, t: F) -> vec<n,F>",
    "(a: mat<r,c,F>, b: mat<r,c,F>, t: F) -> mat<r,c,F>",
    "(a: quat<F>, b: quat<F>, t: F) -> quat<F>",
    "(a: transform<F>, b: transform<F>, t: F) -> transform<F>"],
    "a (1 - t) + b t">;
def Warp_SmoothstepOp : Warp_ScalarMath<"smoothstep",
    ["(a: F, b: F, x: F) -> F"],
    "3 t^2 - 2 t^3 where t is the position of x in [a, b], clamped">;
def Warp_BitCountOp : Warp_ScalarMath<"bit_count", ["(x: I) -> i32"],
    "number of bits set"> { let derivative = NotDifferentiable; }

class Warp_Classification<string mnemonic, string summaryOf>
    : Warp_ScalarMath<mnemonic, ["(a: F) -> bool", "(a: vec<n,F>) -> bool",
        "(a: mat<r,c,F>) -> bool", "(a: quat<F>) -> bool"], summaryOf> {
  let derivative = NotDifferentiable;
}
def Warp_IsFiniteOp : Warp_Classification<"isfinite",
    "whether every component is finite">;
def Warp_IsNanOp : Warp_Classification<"isnan",
    "whether any component is NaN">;
def Warp_IsInfOp : Warp_Classification<"isinf",
    "whether any component is infinite">;

#endif // WARP_SCALAR_MATH_TD

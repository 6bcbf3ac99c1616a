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
    "[-100, 100]", Elementwise<"math::SinOp">> {
  let derivative = Partials<["g * cos(x)"]>;
}
def Warp_CosOp : Warp_FloatFunction<"cos", "cosine of an angle in radians",
    "[-100, 100]", Elementwise<"math::CosOp">> {
  let derivative = Partials<["-g * sin(x)"]>;
}
def Warp_TanOp : Warp_FloatFunction<"tan", "tangent of an angle in radians",
    "[-1.5, 1.5]", Elementwise<"math::TanOp">> {
  let derivative = Partials<["g * (1 + result * result)"]>;
  let smoothDomain = ["[-1.2, 1.2]"];
}
def Warp_AsinOp : Warp_FloatFunction<"asin",
    "arc sine in radians; the operand is clamped to [-1, 1]", "[-1, 1]"> {
  let derivative = Partials<[
    "where(abs(x) > 1, 0, g / sqrt((1 - x) * (1 + x))) unless abs(x) == 1"]>;
  let smoothDomain = ["[-0.9, 0.9]"];
}
def Warp_AcosOp : Warp_FloatFunction<"acos",
    "arc cosine in radians; the operand is clamped to [-1, 1]", "[-1, 1]"> {
  let derivative = Partials<[
    "where(abs(x) > 1, 0, -g / sqrt((1 - x) * (1 + x))) unless abs(x) == 1"]>;
  let smoothDomain = ["[-0.9, 0.9]"];
}
def Warp_AtanOp : Warp_FloatFunction<"atan", "arc tangent in radians",
    "[-100, 100]", Elementwise<"math::AtanOp">> {
  let derivative = Partials<["g / (1 + x * x)"]>;
}
def Warp_SinhOp : Warp_FloatFunction<"sinh", "hyperbolic sine", "[-10, 10]",
    Elementwise<"math::SinhOp">> {
  let derivative = Partials<["g * cosh(x) unless g == 0"]>;
}
def Warp_CoshOp : Warp_FloatFunction<"cosh", "hyperbolic cosine", "[-10, 10]",
    Elementwise<"math::CoshOp">> {
  let derivative = Partials<["g * sinh(x) unless g == 0"]>;
}
def Warp_TanhOp : Warp_FloatFunction<"tanh", "hyperbolic tangent", "[-10, 10]",
    Elementwise<"math::TanhOp">> {
  let derivative = Partials<["4 * g * e / ((1 + e) * (1 + e))"],
                            ["e = exp(-2 * abs(x))"]>;
}
def Warp_DegreesOp : Warp_FloatFunction<"degrees", "radians to degrees",
    "[-10, 10]"> {
  let derivative = Partials<["57.295779513082320877 * g"]>;
}
def Warp_RadiansOp : Warp_FloatFunction<"radians", "degrees to radians",
    "[-500, 500]"> {
  let derivative = Partials<["0.017453292519943295769 * g"]>;
}
def Warp_ExpOp : Warp_FloatFunction<"exp", "exponential", "[-10, 10]",
    Elementwise<"math::ExpOp">> {
  let derivative = Partials<["g * result unless g == 0"]>;
}
def Warp_LogOp : Warp_FloatFunction<"log", "natural logarithm", "[1e-4, 100]",
    Elementwise<"math::LogOp">> {
  let derivative = Partials<["g / x unless x <= 0"]>;
}
def Warp_Log2Op : Warp_FloatFunction<"log2", "logarithm to base 2",
    "[1e-4, 100]", Elementwise<"math::Log2Op">> {
  let derivative = Partials<["1.4426950408889634074 * g / x unless x <= 0"]>;
}
def Warp_Log10Op : Warp_FloatFunction<"log10", "logarithm to base 10",
    "[1e-4, 100]", Elementwise<"math::Log10Op">> {
  let derivative = Partials<["0.43429448190325182765 * g / x unless x <= 0"]>;
}
def Warp_SqrtOp : Warp_FloatFunction<"sqrt", "square root", "[0, 100]",
    Elementwise<"math::SqrtOp">> {
  let derivative = Partials<["g / (2 * result) unless x <= 0"]>;
}
def Warp_CbrtOp : Warp_FloatFunction<"cbrt", "cube root", "[-100, 100]",
    Elementwise<"math::CbrtOp">> {
  let derivative = Partials<["g / (3 * result * result) unless x == 0"]>;
}
def Warp_ErfOp : Warp_FloatFunction<"erf", "error function", "[-3, 3]",
    Elementwise<"math::ErfOp">> {
  let derivative = Partials<["1.1283791670955125739 * g * exp(-x * x)"]>;
}
def Warp_ErfcOp : Warp_FloatFunction<"erfc", "complement of the error function",
    "[-3, 3]", Elementwise<"math::ErfcOp">> {
  let derivative = Partials<["-1.1283791670955125739 * g * exp(-x * x)"]>;
}
def Warp_ErfInvOp : Warp_FloatFunction<"erfinv",
    "inverse of the error function", "[-0.99, 0.99]"> {
  let derivative = Partials<[
    "0.88622692545275801365 * g * exp(result * result) unless abs(x) >= 1"]>;
  let smoothDomain = ["[-0.9, 0.9]"];
}
def Warp_ErfcInvOp : Warp_FloatFunction<"erfcinv",
    "inverse of the complement of the error function", "[0.01, 1.99]"> {
  let derivative = Partials<[
    "-0.88622692545275801365 * g * exp(result * result) "
    "unless x <= 0 or x >= 2"]>;
  let smoothDomain = ["[0.1, 1.9]"];
}

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
    "fraction that remains of x after trunc(x)", "[-100, 100]"> {
  let derivative = Partials<["g"]>;
}

def Warp_Atan2Op : Warp_ScalarMath<"atan2", ["(y: F, x: F) -> F"],
    "angle of the point (x, y) in radians", Elementwise<"math::Atan2Op">> {
  let domain = ["[-10, 10]", "[-10, 10]"];
  // Scaled, so that squares neither overflow nor vanish.
  let derivative = Partials<
    ["g / s * u / (u * u + v * v) unless s == 0 or isinf(s)",
     "-g / s * v / (u * u + v * v) unless s == 0 or isinf(s)"],
    ["s = max(abs(x), abs(y))", "u = x / s", "v = y / s"]>;
}
def Warp_PowOp : Warp_ScalarMath<"pow", ["(x: F, y: F) -> F"],
    "x to the power y", Elementwise<"math::PowFOp">> {
  let domain = ["[0.01, 10]", "[-3, 3]"];
  let derivative = Partials<
    ["where(y == 0, 0, byBase) "
     "unless g == 0 and isnan(byBase) or x == 0 and y < 1 and y != 0",
     "where(x == 0, 0, byExponent) "
     "unless g == 0 and isnan(byExponent) or x == 0 and y <= 0 "
     "requires not x < 0 or g == 0: "
     "a negative base has no derivative by its exponent"],
    ["byBase = g * y * pow(x, y - 1)", "byExponent = g * result * log(x)"]>;
}
def Warp_CopysignOp : Warp_ScalarMath<"copysign", ["(x: F, y: F) -> F"],
    "magnitude of x with the sign of y", Elementwise<"math::CopySignOp">> {
  let domain = ["[-10, 10]", "[-10, 10]"];
  let derivative = Partials<["g * copysign(1, x) * copysign(1, y)", ""]>;
}

defvar AbsOverloads = ["(x: S) -> S", "(x: vec<n,S>) -> vec<n,S>"];
def Warp_AbsOp : Warp_ScalarMath<"abs", AbsOverloads,
    "absolute value, by component"> {
  let derivative = Formulas<[["where(x < 0, -g, g)"], []], ["partials"]>;
  let smoothDomain = ["[-2, 2]"];
}
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
    "counts as missing"> {
  // The second of two equal values is the result.
  let derivative = Formulas<[
    ["where(a < b or b != b, g, 0)", "where(a < b or b != b, 0, g)"], [], []],
    ["partials"]>;
  let smoothDomain = ["[-2, 2]"];
}
def Warp_MaxOp : Warp_ScalarMath<"max", ["(a: S, b: S) -> S",
    "(a: vec<n,S>, b: vec<n,S>) -> vec<n,S>", "(a: vec<n,S>) -> S"],
    "larger value, by component; of one vector, its largest component. A NaN "
    "counts as missing"> {
  // The second of two equal values is the result.
  let derivative = Formulas<[
    ["where(a > b or b != b, g, 0)", "where(a > b or b != b, 0, g)"], [], []],
    ["partials"]>;
  let smoothDomain = ["[-2, 2]"];
}
def Warp_ClampOp : Warp_ScalarMath<"clamp", ["(x: S, low: S, high: S) -> S"],
    "x limited to [low, high]"> {
  let derivative = Partials<
    ["where(below or above, 0, g)", "where(below and not above, g, 0)",
     "where(above, g, 0)"],
    ["below = x < low or x != x", "above = max(x, low) > high"]>;
  let smoothDomain = ["[-2, 2]", "[-1, 0]", "[0, 1]"];
}
def Warp_LerpOp : Warp_ScalarMath<"lerp", ["(a: F, b: F, t: F) -> F",
    "(a: vec<n,F>, b: vec<n,F>, t: F) -> vec<n,F>",
    "(a: mat<r,c,F>, b: mat<r,c,F>, t: F) -> mat<r,c,F>",
    "(a: quat<F>, b: quat<F>, t: F) -> quat<F>",
    "(a: transform<F>, b: transform<F>, t: F) -> transform<F>"],
    "a (1 - t) + b t"> {
  // In the order of the overloads; transforms are expanded.
  let derivative = Formulas<[
    ["g * (1 - t)", "g * t", "g * (b - a)"],
    ["g * (1 - t)", "g * t", "dot(g, b - a)"],
    ["g * (1 - t)", "g * t", "ddot(g, b - a)"],
    ["g * (1 - t)", "g * t", "dot(g, b - a)"], []],
    ["da * (1 - t) + db * t + (b - a) * dt"]>;
  let smoothDomain = ["[-2, 2]"];
}
def Warp_SmoothstepOp : Warp_ScalarMath<"smoothstep",
    ["(a: F, b: F, x: F) -> F"],
    "3 t^2 - 2 t^3 where t is the position of x in [a, b], clamped"> {
  let smoothDomain = ["[-2, -1]", "[1, 2]", "[-0.9, 0.9]"];
}
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

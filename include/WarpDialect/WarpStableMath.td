//===- WarpStableMath.td - Functions that keep their digits --*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Each could be written with other builtins, but the plain formula overflows,
// cancels or divides zero by zero on part of the domain, or its derivative
// does.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_STABLE_MATH_TD
#define WARP_STABLE_MATH_TD

include "WarpScalarMath.td"
include "WarpLinearAlgebra.td"
include "WarpRotations.td"

def Warp_Log1pOp : Warp_FloatFunction<"log1p", "logarithm of 1 + x",
    "[-0.9, 100]", Elementwise<"math::Log1pOp">> {
  let derivative = Partials<["g / (1 + x) unless x + 1 == 0"]>;
}
def Warp_Expm1Op : Warp_FloatFunction<"expm1", "exponential, less 1",
    "[-10, 10]", Elementwise<"math::ExpM1Op">> {
  let derivative = Partials<["g * exp(x) unless g == 0"]>;
}
def Warp_SoftplusOp : Warp_FloatFunction<"softplus",
    "log(1 + exp(x)), a smooth relative of max(x, 0)", "[-30, 30]"> {
  let derivative = Partials<["g / (1 + exp(-x))"]>;
}
def Warp_SincOp : Warp_FloatFunction<"sinc", "sin(x) / x, and 1 at 0",
    "[-30, 30]"> {
  // cos(x) / x - sin(x) / x^2 cancels near 0; the series has terms enough for
  // f64 up to 1.
  let derivative = Partials<
    ["g * where(abs(x) < 1, x * near, (cos(x) - result) / x)"],
    ["t = x * x",
     "far = 1 / 518918400 + t * (-1 / 93405312000 + t / 22230464256000)",
     "near = -1 / 3 + t * (1 / 30 + t * (-1 / 840 + t * (1 / 45360 + "
     "t * (-1 / 3991680 + t * far))))"]>;
}
def Warp_HypotOp : Warp_ScalarMath<"hypot", ["(x: F, y: F) -> F"],
    "sqrt(x^2 + y^2), without overflow or underflow on the way"> {
  let domain = ["[-10, 10]", "[-10, 10]"];
  let derivative = Partials<["g * (x / result) unless result == 0",
                             "g * (y / result) unless result == 0"]>;
}

def Warp_LogsumexpOp : Warp_LinearAlgebra<"logsumexp", ["(a: vec<n,F>) -> F"],
    "logarithm of the sum of the exponentials of the components">;
/// The unit vector from the direction of `a` toward that of `b`.
class TowardFormula<string a, string b> {
  string text = "normalize(normalize(" # b # ") - dot(normalize(" # a #
                "), normalize(" # b # ")) * normalize(" # a # "))";
}
def Warp_AngleBetweenOp : Warp_LinearAlgebra<"angle_between",
    ["(a: vec<n,F>, b: vec<n,F>) -> F"],
    "angle between two vectors in radians, accurate for any angle"> {
  defvar towardA = TowardFormula<"b", "a">.text;
  defvar towardB = TowardFormula<"a", "b">.text;
  let derivative = Formulas<
    [[!strconcat("-g * (", towardB, " / length(a)) unless result == 0"),
      !strconcat("-g * (", towardA, " / length(b)) unless result == 0")]],
    [!strconcat("-dot(", towardB, ", da) / length(a) - dot(", towardA,
                ", db) / length(b) unless result == 0")]>;
}

def Warp_QuatLogOp : Warp_Quaternion<"quat_log", ["(q: quat<F>) -> vec<3,F>"],
    "rotation vector: unit axis times angle in [0, pi]. The length of the "
    "quaternion does not matter">;
def Warp_QuatExpOp : Warp_Quaternion<"quat_exp", ["(v: vec<3,F>) -> quat<F>"],
    "rotation about v by an angle of |v| radians">;

#endif // WARP_STABLE_MATH_TD

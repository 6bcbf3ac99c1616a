//===- WarpLinearAlgebra.td - Vectors and matrices -----------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LINEAR_ALGEBRA_TD
#define WARP_LINEAR_ALGEBRA_TD

include "WarpBuiltinBase.td"

class Warp_LinearAlgebra<string mnemonic, list<string> overloads,
                         string summaryOf, Lowering lowering = ByFunction>
    : Warp_Builtin<mnemonic, "Vectors and matrices", overloads, summaryOf,
                   lowering> {
  let smoothDomain = ["[-2, 2]"];
}

defvar PairOverloads = ["(a: vec<n,S>, b: vec<n,S>) -> vec<n,S>",
                        "(a: mat<r,c,S>, b: mat<r,c,S>) -> mat<r,c,S>"];

def Warp_DotOp : Warp_LinearAlgebra<"dot", ["(a: vec<n,S>, b: vec<n,S>) -> S",
    "(a: quat<F>, b: quat<F>) -> F"], "inner product"> {
  let derivative = Multilinear<[["g * b", "g * a"]]>;
}
def Warp_DdotOp : Warp_LinearAlgebra<"ddot",
    ["(a: mat<r,c,S>, b: mat<r,c,S>) -> S"],
    "sum of the products of corresponding components"> {
  let derivative = Multilinear<[["g * b", "g * a"]]>;
}
def Warp_CrossOp : Warp_LinearAlgebra<"cross",
    ["(a: vec<3,S>, b: vec<3,S>) -> vec<3,S>"], "vector product"> {
  let derivative = Multilinear<[["cross(b, g)", "cross(g, a)"]]>;
}
def Warp_OuterOp : Warp_LinearAlgebra<"outer",
    ["(a: vec<r,S>, b: vec<c,S>) -> mat<r,c,S>"], "outer product a b^T"> {
  let derivative = Multilinear<[["g * b", "a * g"]]>;
}
def Warp_SkewOp : Warp_LinearAlgebra<"skew", ["(vec: vec<3,S>) -> mat<3,3,S>"],
    "matrix whose product with x is the vector product of vec and x">;
def Warp_LengthOp : Warp_LinearAlgebra<"length", ["(a: vec<n,F>) -> F",
    "(a: quat<F>) -> F"],
    "Euclidean length, without overflow or underflow on the way"> {
  let derivative = Formulas<[["g * (a / result) unless result == 0"]],
                            ["dot(a / result, da) unless result == 0"]>;
}
def Warp_LengthSqOp : Warp_LinearAlgebra<"length_sq", ["(a: vec<n,S>) -> S",
    "(a: quat<F>) -> F"], "square of the Euclidean length"> {
  let derivative = Formulas<[["2 * g * a"]], ["2 * dot(a, da)"]>;
}
def Warp_NormalizeOp : Warp_LinearAlgebra<"normalize",
    ["(a: vec<n,F>) -> vec<n,F>", "(a: quat<F>) -> quat<F>"],
    "a scaled to length 1; zero for the zero vector, the identity for the zero "
    "quaternion"> {
  let derivative = Partials<
    ["(g - dot(g, result) * result) / length(a) unless length(a) == 0"]>;
}
def Warp_CwMulOp : Warp_LinearAlgebra<"cw_mul", PairOverloads,
    "product by component", Elementwise<"arith::MulFOp", "arith::MulIOp">> {
  let derivative = Multilinear<[["cw_mul(g, b)", "cw_mul(g, a)"]]>;
}
def Warp_CwDivOp : Warp_LinearAlgebra<"cw_div", PairOverloads,
    "quotient by component"> {
  let derivative = Partials<
    ["cw_div(g, b) unless g == 0",
     "-cw_div(cw_mul(g, result), b) unless g == 0"]>;
}
def Warp_ArgMinOp : Warp_LinearAlgebra<"argmin", ["(a: vec<n,S>) -> u32"],
    "index of the first smallest component; NaN is passed over"> {
  let derivative = NotDifferentiable;
}
def Warp_ArgMaxOp : Warp_LinearAlgebra<"argmax", ["(a: vec<n,S>) -> u32"],
    "index of the first largest component; NaN is passed over"> {
  let derivative = NotDifferentiable;
}

def Warp_TransposeOp : Warp_LinearAlgebra<"transpose",
    ["(a: mat<r,c,S>) -> mat<c,r,S>"], "transpose"> {
  let derivative = Multilinear<[["transpose(g)"]]>;
}
def Warp_DeterminantOp : Warp_LinearAlgebra<"determinant",
    ["(a: mat<2,2,F>) -> F", "(a: mat<3,3,F>) -> F", "(a: mat<4,4,F>) -> F"],
    "determinant"> {
  let derivative = RuleByFunction;
}
defvar InverseRule = Formulas<
    [["-(transpose(result) * g * transpose(result))"]],
    ["-(result * da * result)"]>;
def Warp_InverseOp : Warp_LinearAlgebra<"inverse",
    ["(a: mat<2,2,F>) -> mat<2,2,F>", "(a: mat<3,3,F>) -> mat<3,3,F>",
     "(a: mat<4,4,F>) -> mat<4,4,F>"],
    "inverse; zero where the matrix is singular"> {
  let derivative = InverseRule;
}
def Warp_InverseApproxOp : Warp_LinearAlgebra<"inverse_approx",
    ["(a: mat<2,2,F>) -> mat<2,2,F>", "(a: mat<3,3,F>) -> mat<3,3,F>",
     "(a: mat<4,4,F>) -> mat<4,4,F>"],
    "inverse for programs that allow an error; the same as `inverse` here"> {
  let derivative = InverseRule;
}
def Warp_TraceOp : Warp_LinearAlgebra<"trace", ["(a: mat<n,n,S>) -> S"],
    "sum of the diagonal">;
def Warp_DiagOp : Warp_LinearAlgebra<"diag", ["(vec: vec<n,S>) -> mat<n,n,S>"],
    "diagonal matrix"> {
  let derivative = Multilinear<[["get_diag(g)"]]>;
}
def Warp_GetDiagOp : Warp_LinearAlgebra<"get_diag",
    ["(mat: mat<n,n,S>) -> vec<n,S>"], "diagonal of a square matrix"> {
  let derivative = Multilinear<[["diag(g)"]]>;
}

def Warp_NormL1Op : Warp_LinearAlgebra<"norm_l1", ["(v: vec<n,F>) -> F"],
    "sum of the absolute values">;
def Warp_NormL2Op : Warp_LinearAlgebra<"norm_l2", ["(v: vec<n,F>) -> F"],
    "Euclidean length"> {
  let derivative = Formulas<[["g * (v / result) unless result == 0"]],
                            ["dot(v / result, dv) unless result == 0"]>;
}
def Warp_NormHuberOp : Warp_LinearAlgebra<"norm_huber",
    ["(v: vec<n,F>, delta: F = 1.0) -> F"],
    "Huber loss of the length: half its square up to delta, linear beyond">;
def Warp_NormPseudoHuberOp : Warp_LinearAlgebra<"norm_pseudo_huber",
    ["(v: vec<n,F>, delta: F = 1.0) -> F"],
    "delta sqrt(1 + |v|^2 / delta^2), a smooth relative of norm_huber">;
def Warp_SmoothNormalizeOp : Warp_LinearAlgebra<"smooth_normalize",
    ["(v: vec<n,F>, delta: F = 1.0) -> vec<n,F>"],
    "v divided by norm_pseudo_huber(v, delta)">;

#endif // WARP_LINEAR_ALGEBRA_TD

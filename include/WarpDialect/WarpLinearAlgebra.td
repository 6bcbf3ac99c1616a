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
                   lowering>;

defvar PairOverloads = ["(a: vec<n,S>, b: vec<n,S>) -> vec<n,S>",
                        "(a: mat<r,c,S>, b: mat<r,c,S>) -> mat<r,c,S>"];

def Warp_DotOp : Warp_LinearAlgebra<"dot", ["(a: vec<n,S>, b: vec<n,S>) -> S",
    "(a: quat<F>, b: quat<F>) -> F"], "inner product">;
def Warp_DdotOp : Warp_LinearAlgebra<"ddot",
    ["(a: mat<r,c,S>, b: mat<r,c,S>) -> S"],
    "sum of the products of corresponding components">;
def Warp_CrossOp : Warp_LinearAlgebra<"cross",
    ["(a: vec<3,S>, b: vec<3,S>) -> vec<3,S>"], "vector product">;
def Warp_OuterOp : Warp_LinearAlgebra<"outer",
    ["(a: vec<r,S>, b: vec<c,S>) -> mat<r,c,S>"], "outer product a b^T">;
def Warp_SkewOp : Warp_LinearAlgebra<"skew", ["(v: vec<3,S>) -> mat<3,3,S>"],
    "matrix whose product with x is the vector product of v and x">;
def Warp_LengthOp : Warp_LinearAlgebra<"length", ["(v: vec<n,F>) -> F",
    "(q: quat<F>) -> F"],
    "Euclidean length, without overflow or underflow on the way">;
def Warp_LengthSqOp : Warp_LinearAlgebra<"length_sq", ["(v: vec<n,S>) -> S",
    "(q: quat<F>) -> F"], "square of the Euclidean length">;
def Warp_NormalizeOp : Warp_LinearAlgebra<"normalize",
    ["(v: vec<n,F>) -> vec<n,F>", "(q: quat<F>) -> quat<F>"],
    "v scaled to length 1; zero for the zero vector, the identity for the zero "
    "quaternion">;
def Warp_CwMulOp : Warp_LinearAlgebra<"cw_mul", PairOverloads,
    "product by component", Elementwise<"arith::MulFOp", "arith::MulIOp">>;
def Warp_CwDivOp : Warp_LinearAlgebra<"cw_div", PairOverloads,
    "quotient by component">;
def Warp_ArgMinOp : Warp_LinearAlgebra<"argmin", ["(v: vec<n,S>) -> u32"],
    "index of the first smallest component; NaN is passed over"> {
  let derivative = NotDifferentiable;
}
def Warp_ArgMaxOp : Warp_LinearAlgebra<"argmax", ["(v: vec<n,S>) -> u32"],
    "index of the first largest component; NaN is passed over"> {
  let derivative = NotDifferentiable;
}

def Warp_TransposeOp : Warp_LinearAlgebra<"transpose",
    ["(m: mat<r,c,S>) -> mat<c,r,S>"], "transpose">;
def Warp_DeterminantOp : Warp_LinearAlgebra<"determinant",
    ["(m: mat<2,2,F>) -> F", "(m: mat<3,3,F>) -> F", "(m: mat<4,4,F>) -> F"],
    "determinant">;
def Warp_InverseOp : Warp_LinearAlgebra<"inverse",
    ["(m: mat<2,2,F>) -> mat<2,2,F>", "(m: mat<3,3,F>) -> mat<3,3,F>",
     "(m: mat<4,4,F>) -> mat<4,4,F>"],
    "inverse; zero where the matrix is singular">;
def Warp_TraceOp : Warp_LinearAlgebra<"trace", ["(m: mat<n,n,S>) -> S"],
    "sum of the diagonal">;
def Warp_DiagOp : Warp_LinearAlgebra<"diag", ["(d: vec<n,S>) -> mat<n,n,S>"],
    "diagonal matrix">;
def Warp_GetDiagOp : Warp_LinearAlgebra<"get_diag",
    ["(m: mat<n,n,S>) -> vec<n,S>"], "diagonal of a square matrix">;
#endif // WARP_LINEAR_ALGEBRA_TD

//===- WarpDecompositions.td - Decompositions of matrices ----*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Every decomposition is accurate to a few units in the last place of the norm
// of the matrix, whatever its scale and rank. Rotations have determinant 1.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DECOMPOSITIONS_TD
#define WARP_DECOMPOSITIONS_TD

include "WarpBuiltinBase.td"

class Warp_Decomposition<string mnemonic, list<string> overloads,
                         string summaryOf>
    : Warp_Builtin<mnemonic, "Decompositions", overloads, summaryOf> {
  let derivative = RuleByFunction;
  let smoothDomain = ["[-2, 2]"];
}

def Warp_Svd3Op : Warp_Decomposition<"svd3",
    ["(A: mat<3,3,F>) -> (mat<3,3,F>, vec<3,F>, mat<3,3,F>)",
     "(A: mat<3,3,F>, U: inout mat<3,3,F>, sigma: inout vec<3,F>, "
     "V: inout mat<3,3,F>) -> ()"],
    "singular values: A = U diag(sigma) V^T, with rotations U and V and sigma "
    "decreasing in magnitude; only sigma[2] may be negative, by the sign of "
    "the determinant">;
def Warp_Svd2Op : Warp_Decomposition<"svd2",
    ["(A: mat<2,2,F>) -> (mat<2,2,F>, vec<2,F>, mat<2,2,F>)",
     "(A: mat<2,2,F>, U: inout mat<2,2,F>, sigma: inout vec<2,F>, "
     "V: inout mat<2,2,F>) -> ()"],
    "singular values: A = U diag(sigma) V^T, with orthogonal U, a rotation V "
    "and sigma decreasing, not negative">;
def Warp_Qr3Op : Warp_Decomposition<"qr3",
    ["(A: mat<3,3,F>) -> (mat<3,3,F>, mat<3,3,F>)",
     "(A: mat<3,3,F>, Q: inout mat<3,3,F>, R: inout mat<3,3,F>) -> ()"],
    "A = Q R, with a rotation Q and an upper triangle R; on its diagonal only "
    "the last entry may be negative">;
def Warp_Eig3Op : Warp_Decomposition<"eig3",
    ["(A: mat<3,3,F>) -> (mat<3,3,F>, vec<3,F>)",
     "(A: mat<3,3,F>, Q: inout mat<3,3,F>, d: inout vec<3,F>) -> ()"],
    "eigenvalues of a symmetric matrix: A = Q diag(d) Q^T, with a rotation Q "
    "whose columns are the eigenvectors, and d decreasing. Of any other "
    "matrix, those of its symmetric part">;
def Warp_PolarOp : Warp_Decomposition<"polar",
    ["(A: mat<3,3,F>) -> (mat<3,3,F>, mat<3,3,F>)",
     "(A: mat<3,3,F>, R: inout mat<3,3,F>, S: inout mat<3,3,F>) -> ()"],
    "A = R S, with the rotation R nearest to A and a symmetric S; S has one "
    "negative eigenvalue where the determinant is negative">;

def Warp_SymSqrt3Op : Warp_Decomposition<"sym_sqrt3",
    ["(A: mat<3,3,F>) -> mat<3,3,F>"],
    "square root of a symmetric matrix without negative eigenvalues">;
def Warp_SymLog3Op : Warp_Decomposition<"sym_log3",
    ["(A: mat<3,3,F>) -> mat<3,3,F>"],
    "logarithm of a symmetric matrix with positive eigenvalues">;
def Warp_SymExp3Op : Warp_Decomposition<"sym_exp3",
    ["(A: mat<3,3,F>) -> mat<3,3,F>"], "exponential of a symmetric matrix">;
def Warp_SymSpectral3Op : Warp_Decomposition<"sym_spectral3",
    ["(A: mat<3,3,F>, values: vec<3,F>, slopes: vec<3,F>) -> mat<3,3,F>"],
    "Q diag(values) Q^T with the eigenvectors Q of a symmetric matrix, as eig3 "
    "gives them, where values are a function of the eigenvalues. Of that "
    "function, slopes[k] is the divided difference between the two eigenvalues "
    "other than k, which only the derivative uses">;
def Warp_SymFn3Name : Warp_Special<"sym_fn3", "Decompositions",
    ["(A: Any, f: Any) -> Any"],
    "Q diag(f(d)) Q^T, where A = Q diag(d) Q^T is symmetric and f is a builtin "
    "or a function of one float">;

class Warp_Solve<string n> : Warp_Decomposition<"solve" # n,
    ["(A: mat<" # n # "," # n # ",F>, b: vec<" # n # ",F>) -> vec<" # n #
     ",F>"], "x with A x = b, by elimination with pivoting; zero where A is "
    "singular"> {
  // CSE makes one system of both.
  let derivative = Formulas<
    [["-outer(solve" # n # "(transpose(A), g), result)",
      "solve" # n # "(transpose(A), g)"]],
    ["solve" # n # "(A, db - dA * result)"]>;
}
def Warp_Solve2Op : Warp_Solve<"2">;
def Warp_Solve3Op : Warp_Solve<"3">;
def Warp_Solve4Op : Warp_Solve<"4">;

#endif // WARP_DECOMPOSITIONS_TD

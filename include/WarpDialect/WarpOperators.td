//===- WarpOperators.td - Operators of the kernel language ---*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_OPERATORS_TD
#define WARP_OPERATORS_TD

include "WarpBuiltinBase.td"

class Warp_Operator<string mnemonic, string symbolOf, list<string> overloads,
                    string summaryOf, Lowering lowering = ByFunction>
    : Warp_Builtin<mnemonic, "Operators", overloads, summaryOf, lowering> {
  let symbol = symbolOf;
  let smoothDomain = ["[0.5, 2]"];
}

defvar SumOverloads = [
  "(a: S, b: S) -> S", "(a: vec<n,S>, b: vec<n,S>) -> vec<n,S>",
  "(a: mat<r,c,S>, b: mat<r,c,S>) -> mat<r,c,S>",
  "(a: quat<F>, b: quat<F>) -> quat<F>",
  "(a: transform<F>, b: transform<F>) -> transform<F>"];

def Warp_AddOp : Warp_Operator<"add", "+", SumOverloads, "sum, by component",
    Elementwise<"arith::AddFOp", "arith::AddIOp">> {
  let hasFolder = 1;
  let derivative = Partials<["g", "g"]>;
}
def Warp_SubOp : Warp_Operator<"sub", "-", SumOverloads,
    "difference, by component",
    Elementwise<"arith::SubFOp", "arith::SubIOp">> {
  let hasFolder = 1;
  let derivative = Partials<["g", "-g"]>;
}

def Warp_MulOp : Warp_Operator<"mul", "*", [
    "(a: S, b: S) -> S",
    "(a: vec<n,S>, b: S) -> vec<n,S>", "(a: S, b: vec<n,S>) -> vec<n,S>",
    "(a: mat<r,c,S>, b: S) -> mat<r,c,S>",
    "(a: S, b: mat<r,c,S>) -> mat<r,c,S>",
    "(a: mat<r,c,S>, b: vec<c,S>) -> vec<r,S>",
    "(a: vec<r,S>, b: mat<r,c,S>) -> vec<c,S>",
    "(a: mat<r,k,S>, b: mat<k,c,S>) -> mat<r,c,S>",
    "(a: quat<F>, b: F) -> quat<F>", "(a: F, b: quat<F>) -> quat<F>",
    "(a: quat<F>, b: quat<F>) -> quat<F>",
    "(a: transform<F>, b: F) -> transform<F>",
    "(a: F, b: transform<F>) -> transform<F>",
    "(a: transform<F>, b: transform<F>) -> transform<F>"],
    "product: by component with a scalar, otherwise of matrices, quaternions "
    "(Hamilton) or transforms"> {
  let hasFolder = 1;
  // In the order of the overloads; transforms are expanded.
  let derivative = Multilinear<[
    ["g * b unless g == 0", "a * g unless g == 0"],
    ["g * b unless g == 0", "dot(a, g)"], ["dot(g, b)", "a * g unless g == 0"],
    ["g * b", "ddot(a, g)"], ["ddot(g, b)", "a * g"],
    ["outer(g, b)", "g * a"], ["b * g", "outer(a, g)"],
    ["g * transpose(b)", "transpose(a) * g"],
    ["g * b", "dot(a, g)"], ["dot(g, b)", "a * g"],
    ["g * quat_inverse(b)", "quat_inverse(a) * g"], [], [], []]>;
}

// In the order of the overloads; a number divided by a quaternion is expanded.
defvar QuotientRule = Formulas<[
    ["g / b unless g == 0", "-(g / b) * result unless g == 0"],
    ["g / b unless g == 0", "-dot(g, result) / b unless g == 0"],
    ["dot(g, 1 / b) unless g == 0",
     "-cw_div(cw_mul(g, result), b) unless g == 0"],
    ["g / b unless g == 0", "-ddot(g, result) / b unless g == 0"],
    ["ddot(g, 1 / b) unless g == 0",
     "-cw_div(cw_mul(g, result), b) unless g == 0"],
    ["g / b unless g == 0", "-dot(g, result) / b unless g == 0"], []],
  ["partials", "(da - result * db) / b",
   "da / b - cw_div(cw_mul(result, db), b)", "(da - result * db) / b",
   "da / b - cw_div(cw_mul(result, db), b)",
   "(da - result * db) / b", ""]>;
def Warp_DivOp : Warp_Operator<"div", "/", [
    "(a: S, b: S) -> S", "(a: vec<n,S>, b: S) -> vec<n,S>",
    "(a: S, b: vec<n,S>) -> vec<n,S>",
    "(a: mat<r,c,S>, b: S) -> mat<r,c,S>",
    "(a: S, b: mat<r,c,S>) -> mat<r,c,S>",
    "(a: quat<F>, b: F) -> quat<F>", "(a: F, b: quat<F>) -> quat<F>"],
    "quotient; integers truncate toward zero and give 0 for a zero divisor"> {
  let derivative = QuotientRule;
}
def Warp_DivApproxOp : Warp_Builtin<"div_approx", "Operators", [
    "(a: F, b: F) -> F", "(a: vec<n,F>, b: F) -> vec<n,F>",
    "(a: F, b: vec<n,F>) -> vec<n,F>", "(a: mat<r,c,F>, b: F) -> mat<r,c,F>",
    "(a: F, b: mat<r,c,F>) -> mat<r,c,F>", "(a: quat<F>, b: F) -> quat<F>",
    "(a: F, b: quat<F>) -> quat<F>"],
    "quotient of floats for programs that allow an error; the same as `/` "
    "here"> {
  let derivative = QuotientRule;
  let smoothDomain = ["[0.5, 2]"];
}

def Warp_FloorDivOp : Warp_Operator<"floordiv", "//", ["(a: S, b: S) -> S"],
    "quotient rounded down; integers give 0 for a zero divisor"> {
  let derivative = PiecewiseConstant;
}
def Warp_ModOp : Warp_Operator<"mod", "%", ["(a: S, b: S) -> S",
    "(a: vec<n,S>, b: vec<n,S>) -> vec<n,S>"],
    "remainder with the sign of the dividend, as C has it; integers give 0 for "
    "a zero divisor"> {
  let derivative = Formulas<
    [["g", "-g * trunc(a / b) unless g == 0"], []], ["partials"]>;
}

defvar UnaryOverloads = [
  "(x: S) -> S", "(x: vec<n,S>) -> vec<n,S>", "(x: mat<r,c,S>) -> mat<r,c,S>",
  "(x: quat<F>) -> quat<F>", "(x: transform<F>) -> transform<F>"];
def Warp_NegOp : Warp_Operator<"neg", "-", UnaryOverloads, "negation"> {
  let hasFolder = 1;
  let derivative = Partials<["-g"]>;
}
def Warp_PosOp : Warp_Operator<"pos", "+", UnaryOverloads,
    "the operand itself"> {
  let hasFolder = 1;
  let derivative = Partials<["g"]>;
}

class Warp_BitOperator<string mnemonic, string symbol, string summaryOf,
                       Lowering lowering = ByFunction>
    : Warp_Operator<mnemonic, symbol, ["(a: I, b: I) -> I",
        "(a: vec<n,I>, b: vec<n,I>) -> vec<n,I>",
        "(a: vec<n,I>, b: I) -> vec<n,I>",
        "(a: mat<r,c,I>, b: mat<r,c,I>) -> mat<r,c,I>"], summaryOf, lowering> {
  let derivative = NotDifferentiable;
}
class Warp_LogicOperator<string mnemonic, string symbol, string summaryOf,
                         string op>
    : Warp_BitOperator<mnemonic, symbol, summaryOf, Elementwise<"", op>> {
  let overloads = ["(a: I, b: I) -> I", "(a: bool, b: bool) -> bool",
        "(a: vec<n,I>, b: vec<n,I>) -> vec<n,I>",
        "(a: vec<n,I>, b: I) -> vec<n,I>",
        "(a: mat<r,c,I>, b: mat<r,c,I>) -> mat<r,c,I>"];
}
def Warp_BitAndOp : Warp_LogicOperator<"bit_and", "&", "bitwise and",
                                       "arith::AndIOp">;
def Warp_BitOrOp : Warp_LogicOperator<"bit_or", "|", "bitwise or",
                                      "arith::OrIOp">;
def Warp_BitXorOp : Warp_LogicOperator<"bit_xor", "^", "bitwise exclusive or",
                                       "arith::XOrIOp">;
def Warp_LShiftOp : Warp_BitOperator<"lshift", "<<",
    "shift to the left; by the width or more gives 0">;
def Warp_RShiftOp : Warp_BitOperator<"rshift", ">>",
    "shift to the right, keeping the sign; by the width or more gives 0 or -1">;
def Warp_InvertOp : Warp_Operator<"invert", "~", ["(a: I) -> I",
    "(a: vec<n,I>) -> vec<n,I>", "(a: mat<r,c,I>) -> mat<r,c,I>"],
    "bitwise complement"> {
  let derivative = NotDifferentiable;
}
def Warp_UNotOp : Warp_Operator<"unot", "not",
    ["(a: bool) -> bool", "(a: I) -> bool"], "logical negation"> {
  let derivative = NotDifferentiable;
  let hasFolder = 1;
}

class Warp_Comparison<string mnemonic, string symbol, list<string> overloads,
                      string summaryOf>
    : Warp_Operator<mnemonic, symbol, overloads, summaryOf> {
  let derivative = NotDifferentiable;
}
class Warp_Order<string mnemonic, string symbol, string summaryOf>
    : Warp_Comparison<mnemonic, symbol, ["(a: S, b: S) -> bool",
                                 "(a: bool, b: bool) -> bool"], summaryOf>;
class Warp_Equality<string mnemonic, string symbol, string summaryOf>
    : Warp_Comparison<mnemonic, symbol, ["(a: S, b: S) -> bool",
        "(a: bool, b: bool) -> bool",
        "(a: vec<n,S>, b: vec<n,S>) -> bool",
        "(a: mat<r,c,S>, b: mat<r,c,S>) -> bool",
        "(a: quat<F>, b: quat<F>) -> bool",
        "(a: transform<F>, b: transform<F>) -> bool"], summaryOf>;
def Warp_EqOp : Warp_Equality<"eq", "==", "equal, in every component">;
def Warp_NeOp : Warp_Equality<"ne", "!=", "unequal, in some component">;
def Warp_LtOp : Warp_Order<"lt", "<", "less than">;
def Warp_LeOp : Warp_Order<"le", "<=", "less than or equal">;
def Warp_GtOp : Warp_Order<"gt", ">", "greater than">;
def Warp_GeOp : Warp_Order<"ge", ">=", "greater than or equal">;

def Warp_WhereOp : Warp_Builtin<"where", "Utility", [
    "(cond: bool, value_if_true: A, value_if_false: A) -> A",
    "(cond: I, value_if_true: A, value_if_false: A) -> A"],
    "the second operand where the condition holds, otherwise the third"> {
  let derivative = Formulas<
    [["", "where(cond, g, 0)", "where(cond, 0, g)"]],
    ["where(cond, dvalue_if_true, dvalue_if_false)"]>;
  let smoothDomain = ["[0, 2]", "[-2, 2]", "[-2, 2]"];
}

def Warp_StopGradientOp : Warp_Builtin<"stop_gradient", "Utility", [
    "(x: S) -> S", "(x: bool) -> bool", "(x: vec<n,S>) -> vec<n,S>",
    "(x: mat<r,c,S>) -> mat<r,c,S>", "(x: quat<F>) -> quat<F>",
    "(x: transform<F>) -> transform<F>"],
    "x itself, which derivatives take for a constant"> {
  let derivative = PiecewiseConstant;
}

#endif // WARP_OPERATORS_TD

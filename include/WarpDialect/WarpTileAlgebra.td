//===- WarpTileAlgebra.td - Algebra and stacks of tiles -------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Records like those of WarpTileSpecials.td.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TILE_ALGEBRA_TD
#define WARP_TILE_ALGEBRA_TD

include "WarpTileSpecials.td"

//===----------------------------------------------------------------------===//
// Linear algebra
//===----------------------------------------------------------------------===//

def Warp_TileMatmulName : Warp_TileSpecial<"tile_matmul",
    ["(a: tile<F, [M, K]>, b: tile<G, [K, N]>, out: inout tile<H, [M, N]>, "
     "alpha: Any = 1.0, beta: Any = 1.0, precision: "
     "'default'|'tf32'|'tf32x3' = 'default') -> None",
     "(a: tile<F, [M, K]>, b: tile<G, [K, N]>, alpha: Any = 1.0, precision: "
     "'default'|'tf32'|'tf32x3' = 'default') -> tile"],
    "alpha a b, or out = alpha a b + beta out; floats of 16 bits are summed "
    "in float32",
    ["tiles.algebra.product(node, a, b, alpha, out, beta)",
     "tiles.algebra.product(node, a, b, alpha)"]> {
  let requirements = [
    RequireType<"precision == 'default' or F.python_name == 'float32'",
      "precision='{precision}' requires float32 tiles, got {F.python_name}">];
}

// A square tile of floats that are wide enough to solve with.
class Warp_TileSolver<string name, list<string> overloads, string summary,
                      list<string> calls>
    : Warp_TileSpecial<name, overloads, summary, calls> {
  let requirements = [
    Require<"F.width >= 32",
      "expects a tile of float32 or float64, but got {F.python_name}">];
}
class Warp_TileFactor<string name, string inout, string result, string summary>
    : Warp_TileSolver<name,
    ["(A: " # inout # "tile<F, [N, N]>, "
     "fill_mode: 'lower'|'upper' = 'lower') -> " # result], summary,
    ["make('cholesky', A, upper=fill_mode == 'upper')"]>;
def Warp_TileCholeskyName : Warp_TileFactor<"tile_cholesky", "",
    "tile<F, [N, N]>",
    "triangular factor of a positive definite matrix, of which one "
    "triangle is read; NaN if it is not">;
def Warp_TileCholeskyInplaceName : Warp_TileFactor<"tile_cholesky_inplace",
    "inout ", "None", "the same, in place">;

class Warp_TileSolve<string name, string parameters, string result,
                     string summary, string call>
    : Warp_TileSolver<name, ["(" # parameters # ") -> " # result], summary,
    [call]> {
  let requirements = [
    Require<"F.width >= 32",
      "expects a tile of float32 or float64, but got {F.python_name}">,
    Require<"len(D) <= 2 and D[0] == N and B == F",
      "expects a right side with {N} rows of '{F.python_name}', but got shape "
      "{D} of '{B.python_name}'">];
}
class Warp_TileCholeskySolve<string name, string inout, string result,
                             string summary>
    : Warp_TileSolve<name,
    "L: tile<F, [N, N]>, y: " # inout # "tile<B, D>, "
    "fill_mode: 'lower'|'upper' = 'lower'", result, summary,
    // A lower factor: L x = z, then with its transpose; an upper one: the
    // other way round.
    "make('solve', L, make('solve', L, y, upper=fill_mode == 'upper', "
    "transposed=fill_mode == 'upper'), upper=fill_mode == 'upper', "
    "transposed=fill_mode == 'lower')">;
class Warp_TileTriangularSolve<string name, string matrix, string rhs,
                               string inout, string result, string upper,
                               string summary>
    : Warp_TileSolve<name,
    matrix # ": tile<F, [N, N]>, " # rhs # ": " # inout # "tile<B, D>", result,
    summary,
    "make('solve', " # matrix # ", " # rhs # ", upper=" # upper # ")">;
def Warp_TileCholeskySolveName : Warp_TileCholeskySolve<"tile_cholesky_solve",
    "", "tile<B, D>", "solution of a system whose matrix has this factor">;
def Warp_TileCholeskySolveInplaceName
    : Warp_TileCholeskySolve<"tile_cholesky_solve_inplace", "inout ", "None",
    "the same, in place">;
def Warp_TileLowerSolveName : Warp_TileTriangularSolve<"tile_lower_solve", "L",
    "y", "", "tile<B, D>", "False",
    "solution of L x = y with the lower triangle">;
def Warp_TileLowerSolveInplaceName
    : Warp_TileTriangularSolve<"tile_lower_solve_inplace", "L", "y", "inout ",
    "None", "False", "the same, in place">;
def Warp_TileUpperSolveName : Warp_TileTriangularSolve<"tile_upper_solve", "U",
    "z", "", "tile<B, D>", "True",
    "solution of U x = z with the upper triangle">;
def Warp_TileUpperSolveInplaceName
    : Warp_TileTriangularSolve<"tile_upper_solve_inplace", "U", "z", "inout ",
    "None", "True", "the same, in place">;
def Warp_TileDiagAddName : Warp_TileSpecial<"tile_diag_add",
    ["(a: tile<A, [N, N]>, d: tile<B, [N]>) -> tile<A, [N, N]>"],
    "square tile with its diagonal increased", ["make('diag_add', a, d)"]>;
class Warp_TileTransform<string name, string inverse, string summary>
    : Warp_TileSpecial<name, ["(inout: inout tile<vec<2, F>, D>) -> None"],
    summary, ["make('fft', inout, inverse=" # inverse # ")"]>;
def Warp_TileFftName : Warp_TileTransform<"tile_fft", "False",
    "Fourier transform of each row of complex numbers, in place, not "
    "normalised">;
def Warp_TileIfftName : Warp_TileTransform<"tile_ifft", "True",
    "inverse Fourier transform of each row, in place, not normalised">;

//===----------------------------------------------------------------------===//
// Stacks
//===----------------------------------------------------------------------===//

def Warp_TileStackName : Warp_TileSpecial<"tile_stack",
    ["(capacity: Any, dtype: dtype) -> Any"],
    "empty stack of the block, for at most `capacity` elements",
    ["tiles.stacks.empty(node, capacity, dtype)"]>;
def Warp_TileStackPushName : Warp_TileSpecial<"tile_stack_push",
    ["(s: inout stack, value: value, has_value: condition) -> i32"],
    "pushes what each thread has a value of, in the order of threads; the "
    "slot, or -1 without a value or room",
    ["tiles.stacks.pushed(node, s, value, has_value)"]> {
  let requirements = [
    RequireType<"value.type == s.parts[0].type.element",
      "value of type '{value.type.python_name}' does not match the elements of "
      "'{s.python_name}'">];
}
def Warp_TileStackPopName : Warp_TileSpecial<"tile_stack_pop",
    ["(s: inout stack) -> (A, i32)"],
    "pops a value for each thread: the value and its slot, or zero and -1 "
    "if there is none left",
    ["tiles.stacks.popped(node, s)"]>;
def Warp_TileStackClearName : Warp_TileSpecial<"tile_stack_clear",
    ["(s: inout stack) -> None"],
    "empties a stack", ["tiles.stacks.cleared(node, s)"]>;
def Warp_TileStackCountName : Warp_TileSpecial<"tile_stack_count",
    ["(s: stack) -> i32"],
    "number of elements on a stack", ["tiles.stacks.count(node, s)"]>;

#endif // WARP_TILE_ALGEBRA_TD

//===- WarpLibraryFunctions.td - Library functions -----------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Functions of the kernel language that the package has under `warp`. Overloads
// are Python signatures; a variable that the function assigns is a parameter of
// its type.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIBRARY_FUNCTIONS_TD
#define WARP_LIBRARY_FUNCTIONS_TD

include "WarpBuiltinBase.td"

let module = "language.library" in {
let group = "Quaternions" in {
def : Warp_LibraryFunction<"quat_between_vectors",
    ["(a: vec3f, b: vec3f) -> quatf"],
    "shortest rotation that turns the direction of a into that of b">;
def : Warp_LibraryFunction<"quat_from_euler",
    ["(e: Any, i: int, j: int, k: int) -> Any"],
    "rotation by e[i] about axis i, then e[j] about j, then e[k] about k">;
def : Warp_LibraryFunction<"quat_to_euler",
    ["(q: Any, i: int, j: int, k: int) -> Any"],
    "angles of quat_from_euler, for three different axes; the one about axis j "
    "is in [-pi/2, pi/2]">;
}

let group = "Spatial vectors" in {
def : Warp_LibraryFunction<"spatial_top",
    ["(a: Any) -> Any"],
    "the angular part of a spatial vector">;
def : Warp_LibraryFunction<"spatial_bottom",
    ["(a: Any) -> Any"], "the linear part of a spatial vector">;
def : Warp_LibraryFunction<"spatial_dot",
    ["(a: Any, b: Any) -> Any"], "the inner product of two spatial vectors">;
def : Warp_LibraryFunction<"spatial_cross",
    ["(a: Any, b: Any) -> Any"], "the cross product of two motions">;
def : Warp_LibraryFunction<"spatial_cross_dual",
    ["(a: Any, b: Any) -> Any"], "the cross product of a motion and a force">;
def : Warp_LibraryFunction<"spatial_adjoint",
    ["(r: Any, s: Any) -> Any"],
    "the 6x6 matrix of blocks r, 0 above s, r, which carries motions to "
    "another frame">;
def : Warp_LibraryFunction<"velocity_at_point",
    ["(qd: Any, r: Any) -> Any"],
    "the velocity of the point at r of a body that moves by qd">;
def : Warp_LibraryFunction<"transform_twist",
    ["(t: Any, x: Any) -> Any"], "a motion, carried by a transform">;
def : Warp_LibraryFunction<"transform_wrench",
    ["(t: Any, x: Any) -> Any"], "a force, carried by a transform">;
}

}

let module = "language.random_functions", group = "Random numbers" in {
def : Warp_LibraryFunction<"curlnoise",
    ["(state: Any, xy: vec2f, octaves: Any = ..., lacunarity: float = 2.0, "
     "gain: float = 0.5) -> vec2f",
     "(state: Any, xyz: vec3f, octaves: Any = ..., lacunarity: float = 2.0, "
     "gain: float = 0.5) -> vec3f",
     "(state: Any, xyzt: vec4f, octaves: Any = ..., lacunarity: float = 2.0, "
     "gain: float = 0.5) -> vec3f"],
    "random velocity without divergence at a point: the curl of noise, summed "
    "over octaves, each at `lacunarity` times the frequency and `gain` times "
    "the amplitude of the one before">;
}

let module = "textures.sampling", group = "Textures" in {
def : Warp_LibraryFunction<"texture_sample",
    ["(tex: Texture1D, at: float, dtype: Any, lod: float = ...) -> Any",
     "(tex: Texture2D, at: vec2f, dtype: Any, lod: float = ...) -> Any",
     "(tex: Texture2D, u: float, v: float, dtype: Any, lod: float = ...) -> "
     "Any",
     "(tex: Texture3D, at: vec3f, dtype: Any, lod: float = ...) -> Any",
     "(tex: Texture3D, u: float, v: float, w: float, dtype: Any, lod: float "
     "= ...) -> Any"],
    "value of a texture at a point, of 1, 2 or 4 channels: float32, vec2f or "
    "vec4f; at a level of detail, if one is given">;
}

let module = "language.dense", group = "Dense matrices in arrays" in {
def : Warp_LibraryFunction<"dense_gemm",
    ["(m: int, n: int, p: int, t1: int, t2: int, A: array, B: array, C: "
     "array) -> None"],
    "C = A B of m x p and p x n numbers; with t1, t2 A and B are stored "
    "transposed">;
def : Warp_LibraryFunction<"dense_gemm_batched",
    ["(m: array, n: array, p: array, t1: int, t2: int, A_start: array, "
     "B_start: array, C_start: array, A: array, B: array, C: array) -> None"],
    "`dense_gemm` of the matrices whose number is that of the thread in the "
    "launch">;
def : Warp_LibraryFunction<"dense_chol",
    ["(n: int, A: array, regularization: float, L: array) -> None"],
    "Cholesky factor L of A + regularization I, n x n; above its diagonal L "
    "is left alone">;
def : Warp_LibraryFunction<"dense_chol_batched",
    ["(A_start: array, A_dim: array, A: array, regularization: float, L: "
     "array) -> None"],
    "`dense_chol` of the matrix whose number is that of the thread in the "
    "launch">;
def : Warp_LibraryFunction<"dense_subs",
    ["(n: int, L: array, b: array, x: array) -> None"],
    "solves L L^T x = b for a factor by `dense_chol`">;
def : Warp_LibraryFunction<"dense_solve",
    ["(n: int, A: array, L: array, b: array, x: array) -> None"],
    "solves A x = b by the factor L of A">;
def : Warp_LibraryFunction<"dense_solve_batched",
    ["(b_start: array, A_start: array, A_dim: array, A: array, L: array, b: "
     "array, x: array) -> None"],
    "`dense_solve` of the system whose number is that of the thread in the "
    "launch">;
}

#endif // WARP_LIBRARY_FUNCTIONS_TD

//===- WarpRandom.td - Random numbers ------------------------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The state is one 32-bit integer, advanced and hashed by PCG
// (Jarzynski and Olano, "Hash Functions for GPU Rendering", JCGT 9(3), 2020).
//
//===----------------------------------------------------------------------===//

#ifndef WARP_RANDOM_TD
#define WARP_RANDOM_TD

include "WarpBuiltinBase.td"

class Warp_Random<string mnemonic, list<string> overloads, string summaryOf>
    : Warp_Builtin<mnemonic, "Random numbers", overloads, summaryOf> {
  let derivative = NotDifferentiable;
}

def Warp_RandInitOp : Warp_Random<"rand_init", ["(seed: i32) -> u32",
    "(seed: i32, offset: i32) -> u32"],
    "state of a random sequence; `offset` tells sequences of one seed apart">;
def Warp_RandiOp : Warp_Random<"randi", ["(state: inout u32) -> i32",
    "(state: inout u32, low: i32, high: i32) -> i32"],
    "random integer, in [low, high) where bounds are given">;
def Warp_RanduOp : Warp_Random<"randu", ["(state: inout u32) -> u32",
    "(state: inout u32, low: u32, high: u32) -> u32"],
    "random unsigned integer, in [low, high) where bounds are given">;
def Warp_RandfOp : Warp_Random<"randf", ["(state: inout u32) -> f32",
    "(state: inout u32, low: f32, high: f32) -> f32"],
    "random float in [0, 1), or in [low, high)">;
def Warp_RandnOp : Warp_Random<"randn", ["(state: inout u32) -> f32",
    "(state: inout u32, mean: f32, std: f32) -> f32"],
    "random float of the normal distribution, by Box and Muller">;

class Warp_Sample<string mnemonic, int length, string summaryOf>
    : Warp_Random<mnemonic,
                  ["(state: inout u32) -> vec<" # length # ",f32>"],
                  summaryOf>;

def Warp_SampleUnitRingOp : Warp_Sample<"sample_unit_ring", 2,
    "random point on the circle of radius 1">;
def Warp_SampleUnitDiskOp : Warp_Sample<"sample_unit_disk", 2,
    "random point within the circle of radius 1">;
def Warp_SampleUnitSquareOp : Warp_Sample<"sample_unit_square", 2,
    "random point of the square of side 1 around 0">;
def Warp_SampleUnitCubeOp : Warp_Sample<"sample_unit_cube", 3,
    "random point of the cube of side 1 around 0">;
def Warp_SampleUnitSphereSurfaceOp : Warp_Sample<"sample_unit_sphere_surface", 3,
    "random direction: a point on the sphere of radius 1">;
def Warp_SampleUnitSphereOp : Warp_Sample<"sample_unit_sphere", 3,
    "random point within the sphere of radius 1">;
def Warp_SampleUnitHemisphereSurfaceOp : Warp_Sample<"sample_unit_hemisphere_surface", 3,
    "random direction whose z is not negative">;
def Warp_SampleUnitHemisphereOp : Warp_Sample<"sample_unit_hemisphere", 3,
    "random point within the sphere of radius 1 whose z is not negative">;
def Warp_SampleTriangleOp : Warp_Sample<"sample_triangle", 2,
    "random point of a triangle, as the shares of its first two corners">;

//===----------------------------------------------------------------------===//
// Noise
//===----------------------------------------------------------------------===//

class Warp_Noise<string mnemonic, list<string> overloads, string summaryOf>
    : Warp_Builtin<mnemonic, "Random numbers", overloads, summaryOf> {
  let smoothDomain = ["[0.1, 0.9]"];
}

def Warp_NoiseOp : Warp_Noise<"noise", ["(state: u32, x: f32) -> f32",
    "(state: u32, xy: vec<2,f32>) -> f32",
    "(state: u32, xyz: vec<3,f32>) -> f32",
    "(state: u32, xyzt: vec<4,f32>) -> f32"],
    "smooth random function of a point, zero at points of whole coordinates "
    "(Perlin's gradient noise)"> {
  let derivative = Formulas<
    [["", "g * noise_gradient(state, x)"],
     ["", "g * noise_gradient(state, xy)"],
     ["", "g * noise_gradient(state, xyz)"],
     ["", "g * noise_gradient(state, xyzt)"]],
    ["noise_gradient(state, x) * dx", "dot(noise_gradient(state, xy), dxy)",
     "dot(noise_gradient(state, xyz), dxyz)",
     "dot(noise_gradient(state, xyzt), dxyzt)"]>;
}
def Warp_NoiseGradientOp : Warp_Noise<"noise_gradient",
    ["(state: u32, x: f32) -> f32",
     "(state: u32, xy: vec<2,f32>) -> vec<2,f32>",
     "(state: u32, xyz: vec<3,f32>) -> vec<3,f32>",
     "(state: u32, xyzt: vec<4,f32>) -> vec<4,f32>"],
    "gradient of noise at a point"> {
  let derivative = Formulas<
    [["", "noise_hessian(state, x) * g"],
     ["", "noise_hessian(state, xy) * g"],
     ["", "noise_hessian(state, xyz) * g"],
     ["", "noise_hessian(state, xyzt) * g"]],
    ["noise_hessian(state, x) * dx", "noise_hessian(state, xy) * dxy",
     "noise_hessian(state, xyz) * dxyz", "noise_hessian(state, xyzt) * dxyzt"]>;
}
def Warp_NoiseHessianOp : Warp_Noise<"noise_hessian",
    ["(state: u32, x: f32) -> f32",
     "(state: u32, xy: vec<2,f32>) -> mat<2,2,f32>",
     "(state: u32, xyz: vec<3,f32>) -> mat<3,3,f32>",
     "(state: u32, xyzt: vec<4,f32>) -> mat<4,4,f32>"],
    "second derivatives of noise at a point"> {
  let derivative = NotDifferentiable;
}
def Warp_PnoiseOp : Warp_Noise<"pnoise",
    ["(state: u32, x: f32, px: i32) -> f32",
     "(state: u32, xy: vec<2,f32>, px: i32, py: i32) -> f32",
     "(state: u32, xyz: vec<3,f32>, px: i32, py: i32, pz: i32) -> f32",
     "(state: u32, xyzt: vec<4,f32>, px: i32, py: i32, pz: i32, pt: i32) -> "
     "f32"],
    "noise that repeats itself with a whole period along each axis"> {
  let derivative = Formulas<
    [["", "g * pnoise_gradient(state, x, px)", ""],
     ["", "g * pnoise_gradient(state, xy, px, py)", "", ""],
     ["", "g * pnoise_gradient(state, xyz, px, py, pz)", "", "", ""],
     ["", "g * pnoise_gradient(state, xyzt, px, py, pz, pt)", "", "", "", ""]],
    ["pnoise_gradient(state, x, px) * dx",
     "dot(pnoise_gradient(state, xy, px, py), dxy)",
     "dot(pnoise_gradient(state, xyz, px, py, pz), dxyz)",
     "dot(pnoise_gradient(state, xyzt, px, py, pz, pt), dxyzt)"]>;
}
def Warp_PnoiseGradientOp : Warp_Noise<"pnoise_gradient",
    ["(state: u32, x: f32, px: i32) -> f32",
     "(state: u32, xy: vec<2,f32>, px: i32, py: i32) -> vec<2,f32>",
     "(state: u32, xyz: vec<3,f32>, px: i32, py: i32, pz: i32) -> vec<3,f32>",
     "(state: u32, xyzt: vec<4,f32>, px: i32, py: i32, pz: i32, pt: i32) -> "
     "vec<4,f32>"], "gradient of pnoise at a point"> {
  let derivative = Formulas<
    [["", "pnoise_hessian(state, x, px) * g", ""],
     ["", "pnoise_hessian(state, xy, px, py) * g", "", ""],
     ["", "pnoise_hessian(state, xyz, px, py, pz) * g", "", "", ""],
     ["", "pnoise_hessian(state, xyzt, px, py, pz, pt) * g", "", "", "", ""]],
    ["pnoise_hessian(state, x, px) * dx",
     "pnoise_hessian(state, xy, px, py) * dxy",
     "pnoise_hessian(state, xyz, px, py, pz) * dxyz",
     "pnoise_hessian(state, xyzt, px, py, pz, pt) * dxyzt"]>;
}
def Warp_PnoiseHessianOp : Warp_Noise<"pnoise_hessian",
    ["(state: u32, x: f32, px: i32) -> f32",
     "(state: u32, xy: vec<2,f32>, px: i32, py: i32) -> mat<2,2,f32>",
     "(state: u32, xyz: vec<3,f32>, px: i32, py: i32, pz: i32) -> "
     "mat<3,3,f32>",
     "(state: u32, xyzt: vec<4,f32>, px: i32, py: i32, pz: i32, pt: i32) -> "
     "mat<4,4,f32>"], "second derivatives of pnoise at a point"> {
  let derivative = NotDifferentiable;
}

#endif // WARP_RANDOM_TD

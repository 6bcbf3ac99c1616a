//===- WarpRotations.td - Quaternions and rigid transforms ---*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Quaternions are stored x, y, z, w and multiply by Hamilton's rule. Functions
// that rotate assume a unit quaternion.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_ROTATIONS_TD
#define WARP_ROTATIONS_TD

include "WarpBuiltinBase.td"

class Warp_Quaternion<string mnemonic, list<string> overloads, string summaryOf>
    : Warp_Builtin<mnemonic, "Quaternions", overloads, summaryOf>;
class Warp_RigidTransform<string mnemonic, list<string> overloads,
                          string summaryOf>
    : Warp_Builtin<mnemonic, "Transforms", overloads, summaryOf>;

def Warp_QuatFromAxisAngleOp : Warp_Quaternion<"quat_from_axis_angle",
    ["(axis: vec<3,F>, angle: F) -> quat<F>"],
    "rotation about a unit axis by an angle in radians">;
def Warp_QuatToAxisAngleOp : Warp_Quaternion<"quat_to_axis_angle",
    ["(q: quat<F>) -> (vec<3,F>, F)"],
    "unit axis and angle in [0, pi] of a rotation">;
def Warp_QuatFromMatrixOp : Warp_Quaternion<"quat_from_matrix",
    ["(m: mat<3,3,F>) -> quat<F>", "(m: mat<4,4,F>) -> quat<F>"],
    "rotation of an orthonormal matrix; of a 4x4 matrix, its upper left block">;
def Warp_QuatToMatrixOp : Warp_Quaternion<"quat_to_matrix",
    ["(q: quat<F>) -> mat<3,3,F>"], "matrix of a rotation">;
def Warp_QuatRpyOp : Warp_Quaternion<"quat_rpy",
    ["(roll: F, pitch: F, yaw: F) -> quat<F>"],
    "rotation about x by roll, then y by pitch, then z by yaw, in radians">;
def Warp_QuatInverseOp : Warp_Quaternion<"quat_inverse",
    ["(q: quat<F>) -> quat<F>"], "conjugate of a unit quaternion">;
def Warp_QuatRotateOp : Warp_Quaternion<"quat_rotate",
    ["(q: quat<F>, v: vec<3,F>) -> vec<3,F>"], "v rotated by q">;
def Warp_QuatRotateInvOp : Warp_Quaternion<"quat_rotate_inv",
    ["(q: quat<F>, v: vec<3,F>) -> vec<3,F>"],
    "v rotated by the inverse of q">;
def Warp_QuatSlerpOp : Warp_Quaternion<"quat_slerp",
    ["(a: quat<F>, b: quat<F>, t: F) -> quat<F>"],
    "rotation at t on the shortest arc from a to b, at constant rate">;

def Warp_TransformGetTranslationOp : Warp_RigidTransform<
    "transform_get_translation", ["(t: transform<F>) -> vec<3,F>"],
    "translation of a transform">;
def Warp_TransformGetRotationOp : Warp_RigidTransform<
    "transform_get_rotation", ["(t: transform<F>) -> quat<F>"],
    "rotation of a transform">;
def Warp_TransformSetTranslationOp : Warp_RigidTransform<
    "transform_set_translation",
    ["(t: inout transform<F>, p: vec<3,F>) -> ()"],
    "replaces the translation of a transform">;
def Warp_TransformSetRotationOp : Warp_RigidTransform<
    "transform_set_rotation", ["(t: inout transform<F>, q: quat<F>) -> ()"],
    "replaces the rotation of a transform">;
def Warp_TransformMultiplyOp : Warp_RigidTransform<"transform_multiply",
    ["(a: transform<F>, b: transform<F>) -> transform<F>"],
    "transform that applies b, then a">;
def Warp_TransformInverseOp : Warp_RigidTransform<"transform_inverse",
    ["(t: transform<F>) -> transform<F>"], "inverse transform">;
def Warp_TransformPointOp : Warp_RigidTransform<"transform_point",
    ["(t: transform<F>, p: vec<3,F>) -> vec<3,F>",
     "(t: mat<4,4,F>, p: vec<3,F>) -> vec<3,F>"],
    "point p through a transform or an affine matrix">;
def Warp_TransformVectorOp : Warp_RigidTransform<"transform_vector",
    ["(t: transform<F>, v: vec<3,F>) -> vec<3,F>",
     "(t: mat<4,4,F>, v: vec<3,F>) -> vec<3,F>"],
    "vector v through a transform or an affine matrix, without translation">;

#endif // WARP_ROTATIONS_TD

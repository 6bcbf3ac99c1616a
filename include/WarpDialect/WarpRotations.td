//===- WarpRotations.td - Quaternions and rigid transforms ---*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Quaternions are stored x, y, z, w and multiply by Hamilton's rule. A vector
// is rotated by q v q*, which scales it by the square of the length of q. So do
// transforms, and matrices are those of that.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_ROTATIONS_TD
#define WARP_ROTATIONS_TD

include "WarpBuiltinBase.td"

class Warp_Quaternion<string mnemonic, list<string> overloads, string summaryOf>
    : Warp_Builtin<mnemonic, "Quaternions", overloads, summaryOf> {
  let smoothDomain = ["[-1, 1]"];
}
class Warp_RigidTransform<string mnemonic, list<string> overloads,
                          string summaryOf>
    : Warp_Builtin<mnemonic, "Transforms", overloads, summaryOf> {
  let smoothDomain = ["[-1, 1]"];
}

def Warp_QuatFromAxisAngleOp : Warp_Quaternion<"quat_from_axis_angle",
    ["(axis: vec<3,F>, angle: F) -> quat<F>"],
    "rotation about a unit axis by an angle in radians">;
def Warp_QuatToAxisAngleOp : Warp_Quaternion<"quat_to_axis_angle",
    ["(quat: quat<F>) -> (vec<3,F>, F)",
     "(quat: quat<F>, axis: inout vec<3,F>, angle: inout F) -> ()"],
    "unit axis and angle in [0, pi] of a rotation">;
def Warp_QuatFromMatrixOp : Warp_Quaternion<"quat_from_matrix",
    ["(mat: mat<3,3,F>) -> quat<F>", "(mat: mat<4,4,F>) -> quat<F>"],
    "rotation of an orthonormal matrix; of a 4x4 matrix, its upper left block">;
def Warp_QuatToMatrixOp : Warp_Quaternion<"quat_to_matrix",
    ["(quat: quat<F>) -> mat<3,3,F>"],
    "matrix of a rotation, that of quat_rotate for any quaternion">;
def Warp_QuatRpyOp : Warp_Quaternion<"quat_rpy",
    ["(roll: F, pitch: F, yaw: F) -> quat<F>"],
    "rotation about x by roll, then y by pitch, then z by yaw, in radians">;
def Warp_QuatInverseOp : Warp_Quaternion<"quat_inverse",
    ["(quat: quat<F>) -> quat<F>"], "conjugate of a unit quaternion"> {
  let derivative = Multilinear<[["quat_inverse(g)"]]>;
}
def Warp_QuatRotateOp : Warp_Quaternion<"quat_rotate",
    ["(quat: quat<F>, vec: vec<3,F>) -> vec<3,F>"],
    "a vector, rotated: q v q*, so times the square of the length of q">;
def Warp_QuatRotateInvOp : Warp_Quaternion<"quat_rotate_inv",
    ["(quat: quat<F>, vec: vec<3,F>) -> vec<3,F>"],
    "a vector, rotated by the conjugate: q* v q">;
def Warp_QuatSlerpOp : Warp_Quaternion<"quat_slerp",
    ["(a: quat<F>, b: quat<F>, t: F) -> quat<F>"],
    "rotation at t on the shortest arc from a to b, at constant rate">;
def Warp_QuatToRpyOp : Warp_Quaternion<"quat_to_rpy",
    ["(q: quat<F>) -> vec<3,F>"],
    "angles of quat_rpy: roll and yaw in [-pi, pi], pitch in [-pi/2, pi/2]">;
def Warp_QuatTwistOp : Warp_Quaternion<"quat_twist",
    ["(axis: vec<3,F>, q: quat<F>) -> quat<F>"],
    "part of a rotation that turns about a unit axis">;
def Warp_QuatTwistAngleOp : Warp_Quaternion<"quat_twist_angle",
    ["(axis: vec<3,F>, q: quat<F>) -> F"],
    "angle of quat_twist in radians, without sign">;
def Warp_QuatTwistAngleSignedOp : Warp_Quaternion<"quat_twist_angle_signed",
    ["(axis: vec<3,F>, q: quat<F>) -> F"],
    "angle of quat_twist in radians, by the right-hand rule about the axis">;

def Warp_TransformGetTranslationOp : Warp_RigidTransform<
    "transform_get_translation", ["(xform: transform<F>) -> vec<3,F>"],
    "translation of a transform">;
def Warp_TransformGetRotationOp : Warp_RigidTransform<
    "transform_get_rotation", ["(xform: transform<F>) -> quat<F>"],
    "rotation of a transform">;
def Warp_TransformSetTranslationOp : Warp_RigidTransform<
    "transform_set_translation",
    ["(xform: inout transform<F>, p: vec<3,F>) -> ()"],
    "replaces the translation of a transform">;
def Warp_TransformSetRotationOp : Warp_RigidTransform<
    "transform_set_rotation", ["(xform: inout transform<F>, q: quat<F>) -> ()"],
    "replaces the rotation of a transform">;
def Warp_TransformMultiplyOp : Warp_RigidTransform<"transform_multiply",
    ["(a: transform<F>, b: transform<F>) -> transform<F>"],
    "transform that applies b, then a">;
def Warp_TransformInverseOp : Warp_RigidTransform<"transform_inverse",
    ["(xform: transform<F>) -> transform<F>"], "inverse transform">;
def Warp_TransformPointOp : Warp_RigidTransform<"transform_point",
    ["(xform: transform<F>, point: vec<3,F>) -> vec<3,F>",
     "(mat: mat<4,4,F>, point: vec<3,F>) -> vec<3,F>"],
    "a point through a transform or an affine matrix">;
def Warp_TransformVectorOp : Warp_RigidTransform<"transform_vector",
    ["(xform: transform<F>, vec: vec<3,F>) -> vec<3,F>",
     "(mat: mat<4,4,F>, vec: vec<3,F>) -> vec<3,F>"],
    "a vector through a transform or an affine matrix, without translation">;

def Warp_TransformToMatrixOp : Warp_RigidTransform<"transform_to_matrix",
    ["(xform: transform<F>) -> mat<4,4,F>"], "matrix of a transform">;
def Warp_TransformFromMatrixOp : Warp_RigidTransform<"transform_from_matrix",
    ["(mat: mat<4,4,F>) -> transform<F>"],
    "transform of a matrix without scale">;
def Warp_TransformComposeOp : Warp_RigidTransform<"transform_compose",
    ["(position: vec<3,F>, rotation: quat<F>, scale: vec<3,F>) -> mat<4,4,F>"],
    "matrix that scales along the axes, then rotates, then translates">;
def Warp_TransformDecomposeOp : Warp_RigidTransform<"transform_decompose",
    ["(m: mat<4,4,F>) -> (vec<3,F>, quat<F>, vec<3,F>)"],
    "position, rotation and scale of which transform_compose gives the matrix">;

#endif // WARP_ROTATIONS_TD

// RUN: warp-opt %s --warp-specialize="debug=true" --split-input-file | FileCheck %s
// RUN: warp-opt %s --warp-specialize --split-input-file | FileCheck %s --check-prefix=RELEASE

// A debugging launch asks whether rotations are by quaternions of length 1.
// CHECK-LABEL: func.func @rotate
// CHECK: %[[SQUARE:.*]] = warp.dot(%[[Q:.*]], %[[Q]])
// CHECK: %[[UNIT:.*]] = warp.le
// CHECK: warp.assert %[[UNIT]], "quat_rotate expects a quaternion of length 1
// CHECK-NEXT: warp.quat_rotate(%[[Q]]
// RELEASE-NOT: warp.assert
func.func @rotate(%a: !warp.array<1 x !warp.quat<f32>>, %v: !warp.vec<3 x f32>, %y: !warp.array<1 x !warp.vec<3 x f32>>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %q = warp.load %a[%i] : !warp.array<1 x !warp.quat<f32>>, si32 -> !warp.quat<f32>
  %r = warp.quat_rotate(%q, %v) : (!warp.quat<f32>, !warp.vec<3 x f32>) -> !warp.vec<3 x f32>
  warp.store %r, %y[%i] : !warp.vec<3 x f32>, !warp.array<1 x !warp.vec<3 x f32>>, si32
  return
}

// -----

// A derivative rotates by cotangents, too.
// CHECK-LABEL: func.func @adjoint
// CHECK-NOT: warp.assert
func.func @adjoint(%q: !warp.quat<f32>, %v: !warp.vec<3 x f32>, %y: !warp.array<1 x !warp.vec<3 x f32>>)
    attributes {warp.kernel, warp.primal = "rotate"} {
  %i = warp.tid : si32
  %r = warp.quat_rotate_inv(%q, %v) : (!warp.quat<f32>, !warp.vec<3 x f32>) -> !warp.vec<3 x f32>
  warp.store %r, %y[%i] : !warp.vec<3 x f32>, !warp.array<1 x !warp.vec<3 x f32>>, si32
  return
}

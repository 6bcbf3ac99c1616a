// RUN: warp-opt %s --split-input-file --warp-differentiate-kernel=active=11 \
// RUN:     --cse | FileCheck %s

// The reciprocal of a root serves the derivatives of both: nothing else is
// divided.
// CHECK-LABEL: func.func @root_adjoint
// CHECK: %[[ROOT:.*]] = warp.sqrt
// CHECK: %[[INVERSE:.*]] = warp.div(%{{.*}}, %[[ROOT]])
// CHECK-NOT: warp.div
// CHECK: warp.mul({{.*}}, %[[INVERSE]])
// CHECK-NOT: warp.div
// CHECK: return
func.func @root(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.arg_names = ["x", "y"], warp.kernel} {
  %i = warp.tid : si32
  %one = warp.constant 1.0 : f32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %s = warp.sqrt(%v) : (f32) -> f32
  %r = warp.div(%one, %s) : (f32, f32) -> f32
  warp.store %r, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// The reciprocal of any other number could be infinite where a quotient is not.
// CHECK-LABEL: func.func @number_adjoint
// CHECK: %[[INVERSE:.*]] = warp.div
// CHECK: %[[QUOTIENT:.*]] = warp.div
// CHECK: warp.mul({{.*}}, %[[INVERSE]])
func.func @number(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.arg_names = ["x", "y"], warp.kernel} {
  %i = warp.tid : si32
  %one = warp.constant 1.0 : f32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %r = warp.div(%one, %v) : (f32, f32) -> f32
  warp.store %r, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

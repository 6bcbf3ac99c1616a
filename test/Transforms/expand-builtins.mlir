// RUN: warp-opt %s --split-input-file --warp-expand-builtins --canonicalize --cse | FileCheck %s

// A linear function is its components, put in place.
// CHECK-LABEL: @skew
func.func @skew(%x: !warp.array<1 x !warp.vec<3 x f32>>,
                %y: !warp.array<1 x !warp.mat<3x3 x f32>>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x !warp.vec<3 x f32>>, si32
      -> !warp.vec<3 x f32>
  // CHECK: %[[X:.*]] = warp.extract
  // CHECK: %[[Y:.*]] = warp.extract
  // CHECK: %[[Z:.*]] = warp.extract
  // CHECK: %[[NZ:.*]] = warp.neg(%[[Z]])
  // CHECK: warp.construct(%[[ZERO:.*]], %[[NZ]], %[[Y]], %[[Z]], %[[ZERO]],
  // CHECK-NOT: arith
  %m = warp.skew(%v) : (!warp.vec<3 x f32>) -> !warp.mat<3x3 x f32>
  warp.store %m, %y[%i] : !warp.mat<3x3 x f32>,
      !warp.array<1 x !warp.mat<3x3 x f32>>, si32
  return
}

// -----

// Lengths within a lowering stay builtins, comparisons choose by `where`.
// CHECK-LABEL: @axis_angle
// CHECK: warp.length
// CHECK: warp.eq
// CHECK: warp.normalize
// CHECK: warp.where
// CHECK: %[[FLIPPED:.*]] = warp.lt(%{{.*}}, %{{.*}}) : (f32, f32) -> i1
// CHECK: warp.where(%[[FLIPPED]],
// CHECK-NOT: arith
func.func @axis_angle(%x: !warp.array<1 x !warp.quat<f32>>,
                      %y: !warp.array<1 x !warp.vec<3 x f32>>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %q = warp.load %x[%i] : !warp.array<1 x !warp.quat<f32>>, si32
      -> !warp.quat<f32>
  %axis, %angle = warp.quat_to_axis_angle(%q)
      : (!warp.quat<f32>) -> (!warp.vec<3 x f32>, f32)
  warp.store %axis, %y[%i] : !warp.vec<3 x f32>,
      !warp.array<1 x !warp.vec<3 x f32>>, si32
  return
}

// -----

// Half precision computes in f32 and is rounded once.
// CHECK-LABEL: @half
// CHECK: %[[WIDE:.*]] = warp.cast %{{.*}} : !warp.vec<2 x f16> to !warp.vec<2 x f32>
// CHECK: warp.abs(%{{.*}}) : (f32) -> f32
// CHECK: %[[SUM:.*]] = warp.add
// CHECK: warp.cast %[[SUM]] : f32 to f16
func.func @half(%x: !warp.array<1 x !warp.vec<2 x f16>>,
                %y: !warp.array<1 x f16>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x !warp.vec<2 x f16>>, si32
      -> !warp.vec<2 x f16>
  %n = warp.norm_l1(%v) : (!warp.vec<2 x f16>) -> f16
  warp.store %n, %y[%i] : f16, !warp.array<1 x f16>, si32
  return
}

// -----

// Operations with a formula, without a derivative, or with a derivative of zero
// stay.
// CHECK-LABEL: @kept
// CHECK: warp.cross
// CHECK: warp.sign
// CHECK: warp.argmin
func.func @kept(%x: !warp.array<1 x !warp.vec<3 x f32>>,
                %y: !warp.array<1 x ui32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x !warp.vec<3 x f32>>, si32
      -> !warp.vec<3 x f32>
  %c = warp.cross(%v, %v)
      : (!warp.vec<3 x f32>, !warp.vec<3 x f32>) -> !warp.vec<3 x f32>
  %s = warp.sign(%c) : (!warp.vec<3 x f32>) -> !warp.vec<3 x f32>
  %n = warp.argmin(%s) : (!warp.vec<3 x f32>) -> ui32
  warp.store %n, %y[%i] : ui32, !warp.array<1 x ui32>, si32
  return
}

// -----

// A loop that chooses components is written out, and one around it that chooses
// none stays.
// CHECK-LABEL: @components
// CHECK-COUNT-1: scf.for
// CHECK-NOT: scf.for
// CHECK: warp.extract %[[V:.*]][%{{.*}}] : !warp.vec<2 x f32>
// CHECK: %[[FIRST:.*]] = warp.add
// CHECK: warp.extract %[[V]]
// CHECK: warp.add(%[[FIRST]],
// CHECK: return
func.func @components(%x: !warp.array<1 x !warp.vec<2 x f32>>,
                      %y: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel} {
  %zero = warp.constant 0.0 : f32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %c2 = arith.constant 2 : i32
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x !warp.vec<2 x f32>>, si32
      -> !warp.vec<2 x f32>
  %s = scf.for %j = %c0 to %n step %c1 iter_args(%t = %zero) -> f32 : i32 {
    %u = scf.for %k = %c0 to %c2 step %c1 iter_args(%r = %t) -> f32 : i32 {
      %at = warp.cast %k : i32 to si32
      %e = warp.extract %v[%at] : !warp.vec<2 x f32>, si32 -> f32
      %a = warp.add(%r, %e) : (f32, f32) -> f32
      scf.yield %a : f32
    }
    scf.yield %u : f32
  }
  warp.store %s, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

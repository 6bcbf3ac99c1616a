// RUN: warp-opt %s --split-input-file --warp-expand-builtins --warp-differentiate-kernel=mode=forward --canonicalize --cse | FileCheck %s

// An active array has a twin, which is read and written like it.
// CHECK-LABEL: @straight_tangent(
// CHECK-SAME: %[[X:.*]]: !warp.array<1 x f32>, %[[Y:.*]]: !warp.array<1 x f32>,
// CHECK-SAME: %[[DX:.*]]: !warp.array<1 x f32> {warp.hidden = #warp.hidden<kind = tangent, leaf = 0>},
// CHECK-SAME: %[[DY:.*]]: !warp.array<1 x f32> {warp.hidden = #warp.hidden<kind = tangent, leaf = 1
// CHECK: %[[V:.*]] = warp.load %[[X]]
// CHECK: %[[DV:.*]] = warp.load %[[DX]]
// CHECK: %[[S:.*]] = warp.sin(%[[V]])
// CHECK: %[[C:.*]] = warp.cos(%[[V]])
// CHECK: %[[DS:.*]] = warp.mul(%[[DV]], %[[C]])
// CHECK: warp.store %[[S]], %[[Y]]
// CHECK: warp.store %[[DS]], %[[DY]]
func.func @straight(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %s = warp.sin(%v) : (f32) -> f32
  warp.store %s, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// Tangents are carried beside the values that vary, and only those.
// CHECK-LABEL: @loop_tangent(
// CHECK: %[[R:.*]]:3 = scf.for {{.*}} iter_args(%[[P:.*]] = %{{.*}}, %[[N:.*]] = %{{.*}}, %[[DP:.*]] = %{{.*}}) -> (f32, f32, f32)
// CHECK: %[[L:.*]] = warp.mul(%[[DP]], %[[V:.*]])
// CHECK: %[[Q:.*]] = warp.mul(%[[P]], %[[DV:.*]])
// CHECK: %[[DQ:.*]] = warp.add(%[[L]], %[[Q]])
// CHECK: scf.yield %{{.*}}, %{{.*}}, %[[DQ]]
// CHECK: warp.store %[[R]]#2
func.func @loop(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %begin = arith.constant 0 : index
  %step = arith.constant 1 : index
  %end = arith.constant 8 : index
  %one = warp.constant 1.0 : f32
  %i = warp.tid : si32
  %p:2 = scf.for %k = %begin to %end step %step
      iter_args(%p = %one, %n = %one) -> (f32, f32) {
    %j = warp.cast %k : index to si32
    %v = warp.load %x[%j] : !warp.array<1 x f32>, si32 -> f32
    %q = warp.mul(%p, %v) : (f32, f32) -> f32
    %m = warp.add(%n, %n) : (f32, f32) -> f32
    scf.yield %q, %m : f32, f32
  }
  %z = warp.mul(%p#0, %p#1) : (f32, f32) -> f32
  warp.store %p#0, %y[%i] : f32, !warp.array<1 x f32>, si32
  warp.store %z, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// The gradient of a twin is the twin of the gradient.
// CHECK-LABEL: @adjoint_tangent(
// CHECK-SAME: %[[X:.*]]: !warp.array<1 x f16>,
// CHECK-SAME: %[[DX:.*]]: !warp.array<1 x f32> {
// CHECK: %[[G:.*]] = warp.grad %[[X]] : !warp.array<1 x f16> -> !warp.array<1 x f32>
// CHECK: %[[DG:.*]] = warp.grad %[[DX]] : !warp.array<1 x f32> -> !warp.array<1 x f32>
// CHECK: warp.accumulate %{{.*}}, %[[G]][%{{.*}}] {unique = 1
// CHECK: warp.accumulate %{{.*}}, %[[DG]][%{{.*}}] {unique = 1
func.func @adjoint(%x: !warp.array<1 x f16>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %g = warp.grad %x : !warp.array<1 x f16> -> !warp.array<1 x f32>
  %v = warp.load %x[%i] : !warp.array<1 x f16>, si32 -> f16
  %w = warp.cast %v : f16 to f32
  %s = warp.mul(%w, %w) : (f32, f32) -> f32
  warp.accumulate %s, %g[%i] {unique = 1} : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// A branch yields the tangent of what it chose; one side may have none.
// CHECK-LABEL: @branch_tangent(
// CHECK: %[[Z:.*]] = warp.constant 0.000000e+00 : f32
// CHECK: scf.if %{{.*}} -> (f32, f32) {
// CHECK: scf.yield %{{.*}}, %{{.*}} : f32, f32
// CHECK: } else {
// CHECK: scf.yield %{{.*}}, %[[Z]] : f32, f32
func.func @branch(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>,
                  %c: i1) attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %r = scf.if %c -> f32 {
    %e = warp.exp(%v) : (f32) -> f32
    scf.yield %e : f32
  } else {
    %t = warp.floor(%v) : (f32) -> f32
    scf.yield %t : f32
  }
  warp.store %r, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

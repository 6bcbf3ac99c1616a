// RUN: warp-opt %s --warp-differentiate-kernel=active=11 --canonicalize --cse | FileCheck %s

// x if f else x / t: the quotient, and its adjoint, only where it is chosen.
// CHECK-LABEL: func.func @choose_adjoint
// CHECK: %[[G:.*]] = warp.load
// CHECK: scf.if %{{.*}} -> (f32) {
// CHECK-NEXT: scf.yield
// CHECK-NEXT: } else {
// CHECK: warp.div(%[[G]], %arg2)
// CHECK: warp.accumulate
func.func @choose(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %t: f32,
                  %f: i1) attributes {warp.kernel} {
  %i = warp.tid : si32
  %a = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %q = warp.div(%a, %t) : (f32, f32) -> f32
  %w = warp.where(%f, %a, %q) : (i1, f32, f32) -> f32
  warp.store %w, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

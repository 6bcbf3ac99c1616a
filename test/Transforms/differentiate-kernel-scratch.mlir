// RUN: warp-opt %s --warp-differentiate-kernel=active=11 | FileCheck %s

// Scratch memory is filled in the adjoint, too, before the loops that read it;
// its stores are no part of what a reversed loop needs.
// CHECK-LABEL: func.func @from_outside_adjoint
// CHECK: %[[KEPT:.*]] = warp.scratch : !warp.scratch<8 x si32>
// CHECK: scf.for
// CHECK: %[[AT:.*]] = warp.load %arg2
// CHECK: warp.scratch_store %[[AT]], %[[KEPT]]
// CHECK: scf.for unsigned
// CHECK: scf.for unsigned
// CHECK: %[[READ:.*]] = warp.scratch_load %[[KEPT]]
// CHECK: warp.accumulate %{{.*}}, %0[%[[READ]]]
func.func @from_outside(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>,
                        %p: !warp.array<1 x si32>)
    attributes {warp.kernel} {
  %one = warp.constant 1.0 : f32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %c8 = arith.constant 8 : i32
  %i = warp.tid : si32
  %kept = warp.scratch : !warp.scratch<8 x si32>
  scf.for %k = %c0 to %c8 step %c1 : i32 {
    %at = warp.load %p[%i] : !warp.array<1 x si32>, si32 -> si32
    warp.scratch_store %at, %kept[%k] : si32, !warp.scratch<8 x si32>, i32
  }
  %s = scf.for %k = %c0 to %c8 step %c1 iter_args(%t = %one) -> f32 : i32 {
    %at = warp.scratch_load %kept[%k] : !warp.scratch<8 x si32>, i32 -> si32
    %v = warp.load %x[%at] : !warp.array<1 x f32>, si32 -> f32
    %u = warp.mul(%t, %v) : (f32, f32) -> f32
    scf.yield %u : f32
  }
  warp.store %s, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

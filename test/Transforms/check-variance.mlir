// RUN: warp-opt %s --split-input-file --warp-check-variance | FileCheck %s

// Behind a sum: that it is one, and not negative; in front of the store, that
// the index is its thread's own.
// CHECK-LABEL: func.func @sums
// CHECK: warp.tid : i32
// CHECK: %[[HOLDS:.*]] = arith.cmpi eq, %{{.*}}, %{{.*}} : i32
// CHECK: %[[FAILS:.*]] = arith.xori %[[HOLDS]], %{{.*}} : i1
// CHECK: scf.if %[[FAILS]]
// CHECK: warp.store_components{{.*}}%arg2
// CHECK: arith.cmpi sge
// CHECK: warp.store_components{{.*}}%arg0[
func.func @sums(%x: !warp.array<1 x f32>, %v: f32,
                %claims: !warp.array<1 x si64>)
    attributes {warp.kernel, warp.arg_names = ["x", "v", "warp_claims"]} {
  %c1 = arith.constant 1 : i32
  %i = warp.tid : i32
  %j = arith.addi %i, %c1 : i32
  warp.store_components (%v), %x[%j] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

// Trips are counted in memory of the thread.
// CHECK-LABEL: func.func @loops
// CHECK: %[[COUNT:.*]] = warp.scratch : !warp.scratch<1 x i32>
// CHECK: warp.scratch_store %{{.*}}, %[[COUNT]]
// CHECK: scf.for
// CHECK: %[[BEFORE:.*]] = warp.scratch_load %[[COUNT]]
// CHECK: %[[NOW:.*]] = arith.addi %[[BEFORE]]
// CHECK: warp.scratch_store %[[NOW]], %[[COUNT]]
func.func @loops(%n: i32, %claims: !warp.array<1 x si64>)
    attributes {warp.kernel, warp.arg_names = ["n", "warp_claims"]} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  scf.for %k = %c0 to %n step %c1 : i32 {
  }
  return
}

// -----

// A kernel without the argument stays as it is.
// CHECK-LABEL: func.func @others
// CHECK-NEXT: %[[I:.*]] = warp.tid : i32
// CHECK-NEXT: %{{.*}} = arith.addi %[[I]], %[[I]] : i32
// CHECK-NEXT: return
func.func @others(%claims: !warp.array<1 x si64>)
    attributes {warp.kernel, warp.arg_names = ["claims"]} {
  %i = warp.tid : i32
  %j = arith.addi %i, %i : i32
  return
}

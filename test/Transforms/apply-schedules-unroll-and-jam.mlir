// RUN: warp-opt %s --split-input-file --warp-pipeline="to-launch target=sm_90 packed=3 disjoint=true" --warp-apply-schedules --warp-emit-entry | FileCheck %s

// Two indices of a thread go through the loop together and load once for both;
// the second one stores if there is one.
// CHECK-LABEL: llvm.func ptx_kernelcc @pairs(
// CHECK-SAME: coarsening = 2{{.*}}size_facts = 2
// CHECK: %[[FIRST:.*]] = arith.addi
// CHECK: %[[SECOND:.*]] = arith.addi %[[FIRST]],
// CHECK: scf.if
// CHECK: %[[BOTH:.*]] = arith.cmpi slt, %[[SECOND]]
// CHECK: arith.select %[[BOTH]], %[[SECOND]], %[[FIRST]]
// CHECK-COUNT-2: warp.load_components
// CHECK: %[[SUMS:.*]]:2 = scf.for {{.*}} iter_args({{.*}}, {{.*}}) -> (f32, f32)
// CHECK-COUNT-1: warp.load_components
// CHECK-NOT: warp.load_components
// CHECK: warp.store_components
// CHECK: scf.if %[[BOTH]] {
// CHECK-NEXT: warp.store_components
func.func @pairs(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: si32)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %end = warp.cast %n : si32 to i32
  %zero = arith.constant 0.0 : f32
  %sum = scf.for %j = %c0 to %end step %c1 iter_args(%s = %zero) -> (f32) : i32 {
    %k = warp.cast %j : i32 to si32
    %w = warp.load %x[%k] : !warp.array<1 x f32>, si32 -> f32
    %d = warp.sub(%w, %v) : (f32, f32) -> f32
    %t = warp.add(%s, %d) : (f32, f32) -> f32
    scf.yield %t : f32
  }
  warp.store %sum, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

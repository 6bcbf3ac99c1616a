// RUN: warp-opt %s --split-input-file --warp-pipeline="to-gpu target=sm_90 packed=3 underfilled" | FileCheck %s
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-gpu target=sm_90 packed=3" | FileCheck %s --check-prefix=MANY

// The eight warps of a block have the same 32 indices and an eighth of the loop
// each; the first adds up what the others leave in shared memory.
// CHECK-LABEL: gpu.func @count(
// CHECK-SAME: workgroup({{.*}} : memref<1024xi8
// CHECK-SAME: split_reduction = 8
// CHECK: gpu.thread_id y
// CHECK: scf.for
// CHECK: llvm.store {{.*}} : i32, !llvm.ptr<3>
// CHECK: gpu.barrier
// CHECK: scf.if
// CHECK-COUNT-7: llvm.load {{.*}} : !llvm.ptr<3> -> i32
// CHECK: llvm.store {{.*}} : i32, !llvm.ptr<1>
// MANY-LABEL: gpu.func @count(
// MANY-NOT: split =
// MANY-NOT: gpu.barrier
// MANY: gpu.return
func.func @count(%x: !warp.array<1 x si32>, %y: !warp.array<1 x si32>, %n: si32)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x si32>, si32 -> si32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %end = warp.cast %n : si32 to i32
  %zero = warp.constant 0 : si32
  %sum = scf.for %j = %c0 to %end step %c1 iter_args(%s = %zero) -> (si32) : i32 {
    %k = warp.cast %j : i32 to si32
    %d = warp.mul(%k, %v) : (si32, si32) -> si32
    %t = warp.add(%s, %d) : (si32, si32) -> si32
    scf.yield %t : si32
  }
  warp.store %sum, %y[%i] : si32, !warp.array<1 x si32>, si32
  return
}

// -----

// Sums of floats keep their order.
// CHECK-LABEL: gpu.func @ordered(
// CHECK-NOT: split =
// CHECK-NOT: gpu.barrier
// CHECK: gpu.return
func.func @ordered(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: si32)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %end = warp.cast %n : si32 to i32
  %zero = warp.constant 0.0 : f32
  %sum = scf.for %j = %c0 to %end step %c1 iter_args(%s = %zero) -> (f32) : i32 {
    %t = warp.add(%s, %v) : (f32, f32) -> f32
    scf.yield %t : f32
  }
  warp.store %sum, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// RUN: warp-opt %s --split-input-file --warp-form-launch --warp-apply-schedules --warp-emit-entry | FileCheck %s

#gpu = #warp.variant<target = <name = "sm_90">, rank = 2,
      block_dim = 128>

// One thread: the last dimension is axis x, the one before it y, and a guard
// stands where the CPU has loops. Nothing is divided.
// CHECK-LABEL: llvm.func ptx_kernelcc @plane
// CHECK-SAME: (%[[BLOCK:.*]]: !llvm.ptr {llvm.align = 8 : i64, llvm.byval = !llvm.array<80 x i8>})
// CHECK-SAME: block_dim = 128
// CHECK: gpu.block_id x
// CHECK: gpu.block_dim x
// CHECK: gpu.thread_id x
// CHECK: gpu.block_id y
// CHECK-NOT: arith.div
// CHECK: %[[INSIDE:.*]] = arith.andi
// CHECK-NEXT: scf.if %[[INSIDE]] {
// CHECK-NEXT: warp.store_components(%[[I:.*]]), %{{.*}}[%[[I]], %{{.*}}]
// CHECK-NEXT: }
// CHECK-NOT: warp.store_components
// CHECK: llvm.return
func.func @plane(%a: !warp.array<2 x si32>) attributes {
    warp.kernel, warp.variant = #gpu} {
  %i, %j = warp.tid : i32, i32
  warp.store_components(%i), %a[%i, %j] : (i32), !warp.array<2 x si32>, i32, i32
  return
}

// -----

#gpu2 = #warp.variant<target = <name = "sm_90">, rank = 2,
      index32 = false, flat = true>

// The flat variant divides one 64-bit linear index.
// CHECK-LABEL: llvm.func ptx_kernelcc @flat
// CHECK: gpu.block_id x
// CHECK-NOT: gpu.block_id y
// CHECK-COUNT-1: arith.divui %{{.*}} : i64
// CHECK-NOT: arith.divui
// CHECK: llvm.return
func.func @flat(%a: !warp.array<2 x si32>) attributes {
    warp.kernel, warp.variant = #gpu2} {
  %i, %j = warp.tid : i32, i32
  warp.store_components(%i), %a[%i, %j] : (i32), !warp.array<2 x si32>, i32, i32
  return
}

// -----

#gpu3 = #warp.variant<target = <name = "sm_90">, rank = 3,
      block_dim = 128>

// Threads that work on tiles together are a row of the last dimension; blocks
// are numbered along one axis.
// CHECK-LABEL: llvm.func ptx_kernelcc @rows
// CHECK: %[[ROW:.*]] = gpu.block_id x
// CHECK-NOT: gpu.block_id
// CHECK-NOT: gpu.block_dim
// CHECK: arith.cmpi slt
// CHECK-COUNT-1: arith.divui
// CHECK-NOT: arith.divui
// CHECK: gpu.thread_id x
// CHECK-NOT: gpu.thread_id
// CHECK: llvm.return
func.func @rows(%a: !warp.array<3 x si32>) attributes {
    warp.kernel, warp.block_threads = 128 : i64, warp.variant = #gpu3} {
  %i, %j, %k = warp.tid : i32, i32, i32
  warp.store_components(%i), %a[%i, %j, %k] : (i32), !warp.array<3 x si32>, i32, i32, i32
  return
}

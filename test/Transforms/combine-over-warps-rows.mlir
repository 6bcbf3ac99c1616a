// RUN: warp-opt %s --split-input-file --warp-form-launch --warp-plan-updates --warp-apply-schedules --warp-emit-entry \
// RUN:     --warp-apply-schedules=stage=updates --warp-combine-over-warps | FileCheck %s

#gpu = #warp.variant<target = <name = "sm_90">>

// Each warp of a block adds to a row of the first 256 elements, and the block
// adds the rows of its eight warps to the array at its end.
// CHECK: llvm.mlir.global internal @block_rows_0() {addr_space = 3 : i32{{.*}}} : !llvm.array<2048 x f32>
// CHECK-LABEL: llvm.func ptx_kernelcc @counted
// CHECK: %[[ROWS:.*]] = llvm.mlir.addressof @block_rows_0
// CHECK: %[[ROW:.*]] = arith.muli %{{.*}}, %c256_i32 : i32
// CHECK: gpu.barrier
// CHECK: scf.for %[[K:[a-z0-9]+]] =
// CHECK: %[[IN_ROW:.*]] = arith.cmpi ult, %[[K]], %c256_i32
// CHECK: scf.if %[[IN_ROW]] {
// CHECK: llvm.load
// CHECK: arith.subf
// CHECK: llvm.store
// CHECK: } else {
// CHECK: warp.atomic_components sub
// CHECK: gpu.barrier
// CHECK: scf.for %[[ELEMENT:[a-z0-9]+]] =
// CHECK-COUNT-8: llvm.load {{.*}} : !llvm.ptr<3> -> f32
// CHECK: %[[ANY:.*]] = arith.cmpf une, %[[SUM:.*]], %
// CHECK: scf.if %[[ANY]] {
// CHECK: warp.atomic_components add(%[[SUM]]), %{{.*}}[%[[ELEMENT]]]
func.func @counted(%x: !warp.array<1 x f32>, %w: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %r = scf.for %k = %c0 to %n step %c1 iter_args(%s = %v) -> f32 : i32 {
    %next = math.sin %s : f32
    %old = warp.atomic_components sub(%next), %w[%k]
      : (f32), !warp.array<1 x f32>, i32 -> f32
    scf.yield %next : f32
  }
  warp.store_components(%r), %x[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">>

// Lanes of a ring add to elements in turn, so they wait for their warp.
// CHECK-LABEL: llvm.func ptx_kernelcc @ring
// CHECK: gpu.barrier
// CHECK: gpu.shuffle idx
// CHECK: "llvm.nvvm.bar.warp.sync"
// CHECK: arith.cmpi ult, %{{.*}}, %c256_i32
// CHECK: gpu.barrier
func.func @ring(%x: !warp.array<1 x f32>, %w: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  scf.for %k = %c0 to %n step %c1 : i32 {
    %old = warp.atomic_components add(%v), %w[%k]
      : (f32), !warp.array<1 x f32>, i32 -> f32
  }
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">>

// An element that memory names may be any, and most are beyond a row.
// CHECK-LABEL: llvm.func ptx_kernelcc @listed
// CHECK-NOT: gpu.barrier
func.func @listed(%x: !warp.array<1 x f32>, %w: !warp.array<1 x f32>,
                  %list: !warp.array<1 x si32>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %r = scf.for %k = %c0 to %n step %c1 iter_args(%s = %v) -> f32 : i32 {
    %next = math.sin %s : f32
    %j = warp.load_components %list[%k] : !warp.array<1 x si32>, i32 -> i32
    %old = warp.atomic_components add(%next), %w[%j]
      : (f32), !warp.array<1 x f32>, i32 -> f32
    scf.yield %next : f32
  }
  warp.store_components(%r), %x[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#plain = #warp.variant<target = <name = "sm_90">, lanes = 1>

// The code that schedules are checked against has none.
// CHECK-LABEL: llvm.func ptx_kernelcc @plain
// CHECK-NOT: gpu.barrier
func.func @plain(%x: !warp.array<1 x f32>, %w: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #plain} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %r = scf.for %k = %c0 to %n step %c1 iter_args(%s = %v) -> f32 : i32 {
    %next = math.sin %s : f32
    %old = warp.atomic_components add(%next), %w[%k]
      : (f32), !warp.array<1 x f32>, i32 -> f32
    scf.yield %next : f32
  }
  warp.store_components(%r), %x[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">>

// Four updates are too few for a row.
// CHECK-LABEL: llvm.func ptx_kernelcc @short
// CHECK-NOT: gpu.barrier
func.func @short(%x: !warp.array<1 x f32>, %w: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #gpu} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %c4 = arith.constant 4 : i32
  %i = warp.tid : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %r = scf.for %k = %c0 to %c4 step %c1 iter_args(%s = %v) -> f32 : i32 {
    %next = math.sin %s : f32
    %old = warp.atomic_components add(%next), %w[%k]
      : (f32), !warp.array<1 x f32>, i32 -> f32
    scf.yield %next : f32
  }
  warp.store_components(%r), %x[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm threads=2" | FileCheck %s
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm threads=16" | FileCheck %s --check-prefix=MANY
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm deterministic ordered threads=16" | FileCheck %s --check-prefix=IN-ORDER
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm deterministic ordered target=sm_90" | FileCheck %s --check-prefix=BLOCK

// Two threads are slower than one without atomic instructions; sixteen are not.
// CHECK-LABEL: llvm.func @scatter
// CHECK-SAME: exclusive = true
// CHECK-NOT: atomicrmw
// CHECK: %[[OLD:.*]] = llvm.load %[[AT:[0-9]+]] {alignment = 4 : i64} : !llvm.ptr -> f32
// CHECK: %[[NEW:.*]] = llvm.fadd %[[OLD]], %{{[^ ]*}} : f32
// CHECK: llvm.store %[[NEW]], %[[AT]]
// MANY-LABEL: llvm.func @scatter
// MANY-NOT: exclusive = true
// MANY: llvm.atomicrmw fadd
// MANY: llvm.return
func.func @scatter(%at: !warp.array<1 x si32>, %sum: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %j = warp.load %at[%i] : !warp.array<1 x si32>, si32 -> si32
  %one = warp.constant 1.0 : f32
  %old = warp.atomic add %one, %sum[%j]
    : f32, !warp.array<1 x f32>, si32 -> f32
  return
}

// -----

// A deterministic launch keeps the order of updates whose order shows, if it
// cannot make exact sums.
// IN-ORDER-LABEL: llvm.func @in_order
// IN-ORDER-SAME: exclusive = true
// IN-ORDER-NOT: atomicrmw
func.func @in_order(%x: !warp.array<1 x f32>, %to: !warp.array<1 x si32>,
                    %sum: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %j = warp.load %to[%i] : !warp.array<1 x si32>, si32 -> si32
  %old = warp.atomic add %v, %sum[%j]
    : f32, !warp.array<1 x f32>, si32 -> f32
  return
}

// -----

// Integers have none.
// IN-ORDER-LABEL: llvm.func @any_order
// IN-ORDER: atomicrmw add
func.func @any_order(%to: !warp.array<1 x si32>, %sum: !warp.array<1 x si32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %j = warp.load %to[%i] : !warp.array<1 x si32>, si32 -> si32
  %old = warp.atomic add %j, %sum[%j]
    : si32, !warp.array<1 x si32>, si32 -> si32
  return
}

// -----

// On a GPU a deterministic launch is one block. Where its threads' sums can be
// combined they are, in the block's order; else the block has one thread.
// BLOCK-LABEL: llvm.func @combined(
// BLOCK-SAME: nvvm.kernel
// BLOCK-SAME: #warp.schedule<{{.*}}single_block = 256
// BLOCK: nvvm.shfl.sync down
func.func @combined(%x: !warp.array<2 x f32>, %sum: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i, %j = warp.tid : si32, si32
  %v = warp.load %x[%i, %j] : !warp.array<2 x f32>, si32, si32 -> f32
  %zero = warp.constant 0 : si32
  %old = warp.atomic add %v, %sum[%zero]
    : f32, !warp.array<1 x f32>, si32 -> f32
  return
}

// -----

// BLOCK-LABEL: llvm.func @scattered(
// BLOCK-SAME: nvvm.kernel
// BLOCK-SAME: #warp.schedule<{{.*}}single_block = 1
// BLOCK: llvm.atomicrmw fadd
func.func @scattered(%x: !warp.array<1 x f32>, %to: !warp.array<1 x si32>,
                     %sum: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %j = warp.load %to[%i] : !warp.array<1 x si32>, si32 -> si32
  %old = warp.atomic add %v, %sum[%j]
    : f32, !warp.array<1 x f32>, si32 -> f32
  return
}

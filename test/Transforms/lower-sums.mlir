// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm deterministic threads=16" | FileCheck %s
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm deterministic threads=1" | FileCheck %s --check-prefix=ALONE
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm deterministic target=sm_90" | FileCheck %s --check-prefix=GPU

// A float has two digits; each is added to the word of its weight, which is
// marked as touched.
// CHECK: llvm.func internal @warp_add_exactly_f32
// CHECK-COUNT-2: llvm.atomicrmw add
// CHECK: llvm.atomicrmw _or
// CHECK-LABEL: llvm.func @scatter
// CHECK-NOT: exclusive = true
// CHECK: llvm.call @warp_add_exactly_f32
// CHECK: llvm.return

// A launch that no other thread shares has no need of atomic instructions.
// ALONE-LABEL: llvm.func @scatter
// ALONE: llvm.call @warp_add_exactly_
// ALONE: llvm.return

// The block knows the arguments, and where the sums are.
// GPU: llvm.atomicrmw add {{.*}} syncscope("device")
// GPU-LABEL: llvm.func @scatter(
// GPU-SAME: !llvm.array<224 x i8>
// GPU-SAME: nvvm.kernel
// GPU-NOT: exclusive = true
// GPU: llvm.call @warp_add_exactly_f32
func.func @scatter(%x: !warp.array<1 x f32>, %to: !warp.array<1 x si32>,
                   %sum: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %j = warp.load %to[%i] : !warp.array<1 x si32>, si32 -> si32
  %old = warp.atomic add %v, %sum[%j]
    : f32, !warp.array<1 x f32>, si32 -> f32
  return
}

// -----

// A sum into one element is made by a range on its own, in memory on the stack,
// or by a block in shared memory.
// CHECK-LABEL: llvm.func @one_address
// CHECK: llvm.alloca {{.*}} x !llvm.array<256 x f64>
// CHECK: llvm.alloca {{.*}} x !llvm.array<76 x i64>
// CHECK: ^[[LOOP:bb[0-9]+]](%{{[^:]*}}: i64):
// CHECK: llvm.call @warp_append_to_sum_f64
// CHECK: llvm.br ^[[LOOP]](
// CHECK-NOT: ^[[LOOP]](
// CHECK: llvm.call @warp_flush_sum_f64
// CHECK: llvm.call @warp_add_sum_f64

// GPU: llvm.mlir.global internal @__wg_one_address_0() {addr_space = 3 {{.*}} : !llvm.array<75 x i64>
// GPU-LABEL: llvm.func @one_address(
// GPU-SAME: nvvm.kernel
// GPU: llvm.call @warp_add_to_window_f64
// GPU: nvvm.shfl.sync bfly
// GPU: llvm.atomicrmw add {{.*}} syncscope("block")
// GPU: llvm.call @warp_add_digit
func.func @one_address(%x: !warp.array<1 x f64>, %sum: !warp.array<1 x f64>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x f64>, si32 -> f64
  %zero = warp.constant 0 : si32
  %old = warp.atomic add %v, %sum[%zero]
    : f64, !warp.array<1 x f64>, si32 -> f64
  return
}

// -----

// Minima and integers have one result in any order; their launch is as usual.
// A processor's own minimum would leave the order of zeros open.
// CHECK-LABEL: llvm.func @any_order
// CHECK-NOT: exclusive = true
// CHECK-NOT: llvm.atomicrmw fmin
// CHECK: llvm.cmpxchg
// CHECK: llvm.atomicrmw add
// GPU-LABEL: llvm.func @any_order(
// GPU-SAME: nvvm.kernel
// GPU-NOT: exclusive = true
// GPU: llvm.return
func.func @any_order(%to: !warp.array<1 x si32>, %least: !warp.array<1 x f32>,
                     %count: !warp.array<1 x si32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %j = warp.load %to[%i] : !warp.array<1 x si32>, si32 -> si32
  %x = warp.cast %j : si32 to f32
  %a = warp.atomic min %x, %least[%j]
    : f32, !warp.array<1 x f32>, si32 -> f32
  %b = warp.atomic add %i, %count[%j]
    : si32, !warp.array<1 x si32>, si32 -> si32
  return
}

// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm threads=2" | FileCheck %s
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm threads=16" | FileCheck %s --check-prefix=MANY
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm target=sm_90" | FileCheck %s --check-prefix=GPU
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm deterministic ordered threads=16" | FileCheck %s --check-prefix=IN-ORDER
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm deterministic ordered target=sm_90" | FileCheck %s --check-prefix=BLOCK

// A sum into one element leaves the loop; its partial sums may be reordered.
// CHECK-LABEL: llvm.func @one_address
// CHECK: %[[SLOT:.*]] = llvm.alloca {{.*}} x f32
// CHECK: llvm.fadd {{.*}} {fastmathFlags = #llvm.fastmath<{{.*}}reassoc{{.*}}>}
// CHECK: llvm.cond_br {{.*}} {loop_annotation
// CHECK: %[[TOTAL:.*]] = llvm.load %[[SLOT]]
// CHECK: llvm.atomicrmw fadd {{.*}}, %[[TOTAL]] monotonic
// GPU-LABEL: llvm.func ptx_kernelcc @one_address
// GPU: "llvm.nvvm.barrier.cta.red.or.aligned.all"
// GPU: "llvm.nvvm.shfl.sync.down.i32"
// GPU: "llvm.nvvm.barrier.cta.sync.aligned.all"
// GPU: llvm.atomicrmw fadd {{.*}} syncscope("device") monotonic
func.func @one_address(%x: !warp.array<1 x f32>, %sum: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %zero = warp.constant 0 : si32
  %old = warp.atomic add %v, %sum[%zero]
    : f32, !warp.array<1 x f32>, si32 -> f32
  return
}

// -----

// Reading the array elsewhere, or using the old value, keeps each update.
// CHECK-LABEL: llvm.func @read_back
// CHECK-NOT: fastmath<{{.*}}reassoc
func.func @read_back(%x: !warp.array<1 x f32>, %sum: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %zero = warp.constant 0 : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %old = warp.atomic add %v, %sum[%zero]
    : f32, !warp.array<1 x f32>, si32 -> f32
  %now = warp.load %sum[%zero] : !warp.array<1 x f32>, si32 -> f32
  warp.store %now, %x[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// Two threads are slower than one without atomic instructions; sixteen are not.
// CHECK-LABEL: llvm.func @scatter
// CHECK-SAME: #warp.recipe<{{.*}}exclusive = true
// CHECK-NOT: atomicrmw
// CHECK: %[[OLD:.*]] = llvm.load %{{[0-9]+}} {alignment = 4 : i64}
// CHECK: llvm.fadd %[[OLD]]
// MANY-LABEL: llvm.func @scatter
// MANY-NOT: exclusive = true
// MANY: llvm.atomicrmw fadd
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

// Gradients of an argument have one name, too; their sum leaves the loop, with
// 64 bits.
// CHECK-LABEL: llvm.func @one_gradient
// CHECK: llvm.fpext {{.*}} : f32 to f64
// CHECK: llvm.fadd {{.*}} {fastmathFlags = #llvm.fastmath<{{.*}}reassoc{{.*}}>} : f64
// CHECK: llvm.cond_br {{.*}} {loop_annotation
// CHECK: llvm.fptrunc {{.*}} : f64 to f32
// CHECK: llvm.atomicrmw fadd
// GPU-LABEL: llvm.func ptx_kernelcc @one_gradient
// GPU: "llvm.nvvm.barrier.cta.red.or.aligned.all"
func.func @one_gradient(%x: !warp.array<1 x f32>, %p: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %zero = warp.constant 0 : si32
  %g = warp.grad %p : !warp.array<1 x f32> -> !warp.array<1 x f32>
  warp.accumulate %v, %g[%zero] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// A deterministic launch keeps the order of updates whose order shows, if it
// cannot make exact sums.
// IN-ORDER-LABEL: llvm.func @in_order
// IN-ORDER-SAME: #warp.recipe<{{.*}}exclusive = true
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
// BLOCK-LABEL: llvm.func ptx_kernelcc @combined
// BLOCK-SAME: warp.recipe = #warp.recipe<items = 256, exclusive = true
// BLOCK: "llvm.nvvm.shfl.sync.down.i32"
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

// BLOCK-LABEL: llvm.func ptx_kernelcc @scattered
// BLOCK-SAME: warp.recipe = #warp.recipe<exclusive = true
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

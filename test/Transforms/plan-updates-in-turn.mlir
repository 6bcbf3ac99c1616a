// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm thread-order threads=16" | FileCheck %s
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm threads=16" | FileCheck %s --check-prefix=ANY
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm thread-order target=sm_90" | FileCheck %s --check-prefix=GPU

// One thread hands out slots, without atomic instructions; on a GPU all do. The
// code is for launches that keep the order, or for those that do not.
// CHECK-LABEL: llvm.func @slots
// CHECK-SAME: exclusive = true{{.*}}size_facts = 32
// CHECK-NOT: atomicrmw
// ANY-LABEL: llvm.func @slots
// ANY-NOT: exclusive = true
// Lanes may not be worth it for few threads.
// ANY-SAME: size_facts = 34,
// ANY-NOT: exclusive = true
// ANY: llvm.atomicrmw add
// GPU-LABEL: llvm.func @slots
// GPU-NOT: size_facts = 32
// GPU-NOT: exclusive = true
// GPU: llvm.atomicrmw add
func.func @slots(%used: !warp.array<1 x si32>, %holder: !warp.array<1 x si32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %zero = warp.constant 0 : si32
  %one = warp.constant 1 : si32
  %slot = warp.atomic add %one, %used[%zero]
    : si32, !warp.array<1 x si32>, si32 -> si32
  warp.store %i, %holder[%slot] : si32, !warp.array<1 x si32>, si32
  return
}

// -----

// An exchange says who came last.
// CHECK-LABEL: llvm.func @exchange
// CHECK-SAME: exclusive = true
// CHECK-NOT: atomicrmw
func.func @exchange(%last: !warp.array<1 x si32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %zero = warp.constant 0 : si32
  %old = warp.atomic exch %i, %last[%zero]
    : si32, !warp.array<1 x si32>, si32 -> si32
  return
}

// -----

// Nobody sees the order of sums, so one code does for launches of any size.
// CHECK-LABEL: llvm.func @sums
// CHECK-NOT: size_facts = 32
// CHECK-NOT: exclusive = true
// CHECK: llvm.atomicrmw fadd
func.func @sums(%x: !warp.array<1 x f32>, %to: !warp.array<1 x si32>,
                %sum: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %j = warp.load %to[%i] : !warp.array<1 x si32>, si32 -> si32
  %old = warp.atomic add %v, %sum[%j]
    : f32, !warp.array<1 x f32>, si32 -> f32
  return
}

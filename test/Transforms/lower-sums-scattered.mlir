// RUN: warp-opt %s --warp-pipeline="to-llvm deterministic target=sm_90" | FileCheck %s

// Threads that add to elements of their own do not add for each other. (Where a
// thread is in the grid has no operands, and is still not the same for all.)
// CHECK-LABEL: llvm.func @neighbours(
// CHECK-NOT: warp_add_to_window
// CHECK: llvm.call @warp_add_exactly_f32
// CHECK-NOT: warp_add_to_window
// CHECK: llvm.call @warp_add_exactly_f32
// CHECK-NOT: warp_add_to_window
// CHECK: llvm.return
func.func @neighbours(%x: !warp.array<1 x f32>, %sum: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %one = warp.constant 1 : si32
  %next = warp.add(%i, %one) : (si32, si32) -> si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %old = warp.atomic add %v, %sum[%i] : f32, !warp.array<1 x f32>, si32 -> f32
  %other = warp.atomic add %v, %sum[%next]
    : f32, !warp.array<1 x f32>, si32 -> f32
  return
}

// RUN: warp-opt %s --warp-specialize="target=sm_90 large packed=3" --warp-lower-composites --warp-form-launch --warp-plan-updates --warp-combine-over-groups --warp-apply-schedules --warp-emit-entry | FileCheck %s

// Threads of a large launch that do little but add to one element take many
// items each, eight at a time, so that a block combines once for all of them.
// The last block takes what is left one by one.
// CHECK-LABEL: llvm.func ptx_kernelcc @sum
// CHECK-SAME: #warp.schedule<coarsening = 32
// CHECK: scf.if
// CHECK: scf.for
// CHECK-COUNT-8: warp.load_components
// CHECK-NOT: warp.load_components
// CHECK: } else {
// CHECK: scf.for
// CHECK-COUNT-1: warp.load_components
// CHECK-NOT: warp.load_components
// CHECK: gpu.shuffle
// CHECK: gpu.barrier
func.func @sum(%x: !warp.array<1 x f32>, %total: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.arg_names = ["x", "total"]} {
  %i = warp.tid : si32
  %zero = warp.constant 0 : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %old = warp.atomic add %v, %total[%zero]
    : f32, !warp.array<1 x f32>, si32 -> f32
  return
}

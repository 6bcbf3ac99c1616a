// Kernels of CPUs call the device library's machine code for the level of their
// processor and hold none of it.
//
// REQUIRES: x86-64
// RUN: warp-opt %s --warp-emit=asm --warp-options="target=cpu:x86-64-v2" \
// RUN:   | FileCheck %s -DLEVEL=v1
// RUN: warp-opt %s --warp-emit=asm --warp-options="target=cpu:haswell" \
// RUN:   | FileCheck %s -DLEVEL=v3
// RUN: warp-opt %s --warp-emit=asm --warp-options="target=cpu:skylake-avx512" \
// RUN:   | FileCheck %s -DLEVEL=v4

// CHECK-NOT: warp_mesh_furthest{{.*}}:
// CHECK: warp_mesh_furthest.[[LEVEL]]
// CHECK-NOT: warp_mesh_furthest{{.*}}:
func.func @reach(%mesh: ui64, %x: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %zero = warp.constant 0.0 : f32
  %from = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %hit:3 = warp.library_call "warp_mesh_furthest"(%mesh, %from, %zero, %zero, %zero)
      : (ui64, f32, f32, f32, f32) -> (si32, f32, f32)
  warp.store %hit#1, %x[%i] : f32, !warp.array<1 x f32>, si32
  return
}

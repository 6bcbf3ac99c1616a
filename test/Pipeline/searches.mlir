// Threads that search geometry leave room for others: they wait for memory at
// each step. The user's choice comes first.
//
// RUN: warp-opt %s --warp-emit=ptx --warp-options="target=sm_90" \
// RUN:   | FileCheck %s
// RUN: warp-opt %s --warp-emit=ptx \
// RUN:   --warp-options="target=sm_90,max-registers=128" \
// RUN:   | FileCheck %s --check-prefix=ASKED

// CHECK: .entry cast
// CHECK: .maxntid 256
// CHECK-NEXT: .maxnreg 64
// ASKED: .entry cast
// ASKED: .maxnreg 128
func.func @cast(%mesh: ui64, %x: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %root = warp.constant -1 : si32
  %far = warp.constant 1.0e+03 : f32
  %zero = warp.constant 0.0 : f32
  %from = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %hit:4 = warp.library_call "warp_mesh_ray"(%mesh, %from, %zero, %zero, %zero, %zero, %far, %far, %root)
      : (ui64, f32, f32, f32, f32, f32, f32, f32, si32) -> (si32, f32, f32, f32)
  warp.store %hit#3, %x[%i] : f32, !warp.array<1 x f32>, si32
  return
}

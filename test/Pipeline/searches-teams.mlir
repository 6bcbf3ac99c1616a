// Lanes that search together are known when the kernel is compiled: exchanges
// whose mask is a register would first have to find out who takes part.
//
// RUN: warp-opt %s --warp-emit=ptx --warp-options="target=sm_90" \
// RUN:   | FileCheck %s \
// RUN:     --implicit-check-not="{{(shfl|vote|bar.warp).*sync.* %r[0-9]+;}}"

// CHECK: .entry near
// CHECK: activemask.b32
// CHECK: shfl.sync.bfly.b32 {{.*}}, -1;
// CHECK: vote.sync.ballot.b32 {{.*}}, -1;
func.func @near(%mesh: ui64, %x: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %far = warp.constant 1.0e+03 : f32
  %zero = warp.constant 0.0 : f32
  %at = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %point:3 = warp.library_call "warp_mesh_closest"(%mesh, %at, %zero, %zero, %far)
      : (ui64, f32, f32, f32, f32) -> (si32, f32, f32)
  warp.store %point#1, %x[%i] : f32, !warp.array<1 x f32>, si32
  return
}

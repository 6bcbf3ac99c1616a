// RUN: warp-opt %s --warp-emit=ptx --warp-options=target=sm_90,rank=2,block_dim=32,index32,packed=3 | FileCheck %s

// A matrix of rows of 27 numbers is on its way as a whole before a thread
// waits: no element passes by the registers. Where a part of it lies beyond the
// array, zeros come in its place.
// CHECK-LABEL: .entry factor(
// CHECK-NOT: ld.global
// CHECK-DAG: cp.async.ca.shared.global [%r{{.*}}], [%rd{{.*}}], 4, %r
// CHECK-DAG: cp.async.ca.shared.global [%r{{.*}}], [%rd{{.*}}], 4;
// CHECK: cp.async.wait_group 0;
// CHECK: bar.warp.sync
func.func @factor(%a: !warp.array<3 x f32>, %x: !warp.array<3 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64} {
  %c0 = warp.constant 0 : si32
  %i, %lane = warp.tid : si32, si32
  %b = warp.view %a[%i] : !warp.array<3 x f32>, si32 -> !warp.array<2 x f32>
  %m = warp.tile_load %b[%c0, %c0] : !warp.array<2 x f32>, (si32, si32)
    -> !warp.tile<27x27 x f32>
  %l = warp.tile_cholesky %m : !warp.tile<27x27 x f32>
  %y = warp.view %x[%i] : !warp.array<3 x f32>, si32 -> !warp.array<2 x f32>
  warp.tile_store %l, %y[%c0, %c0] : !warp.tile<27x27 x f32>,
    !warp.array<2 x f32>, (si32, si32)
  return
}

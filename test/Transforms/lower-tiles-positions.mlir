// RUN: warp-opt %s --warp-pipeline="to-thread target=sm_90" | FileCheck %s

// Threads of a block exchange their best elements and where those are, and all
// of them know the position in the end.
// CHECK-LABEL: func.func @least
// CHECK: %[[OWN:.*]] = warp.scratch : !warp.scratch<2 x f32>
// CHECK: warp.library_call "warp_tile_combine_argmin"(%[[OWN]]
// CHECK-NOT: scf.if
// CHECK: warp.scratch_store {{.*}} !warp.scratch<1 x i32>
func.func @least(%a: !warp.array<1 x f32>, %at: !warp.array<1 x si32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64} {
  %c0 = warp.constant 0 : si32
  %t = warp.tile_load %a[%c0] : !warp.array<1 x f32>, (si32) -> !warp.tile<64 x f32>
  %k = warp.tile_arg_reduce min %t : !warp.tile<64 x f32> -> !warp.tile<1 x si32>
  warp.tile_store %k, %at[%c0] : !warp.tile<1 x si32>, !warp.array<1 x si32>, (si32)
  return
}

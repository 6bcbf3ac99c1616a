// RUN: warp-opt %s --split-input-file --warp-place-tiles --warp-plan-tile-memory --warp-place-barriers --warp-lower-tiles | FileCheck %s

#gpu = #warp.variant<target = <name = "sm_90">, rank = 2>

// A matrix is copied by all threads at once, and waited for where they meet.
// CHECK-LABEL: func.func @factor
// CHECK: warp.library_call "warp_tile_fetch_b32"
// CHECK-NEXT: warp.library_call "warp_tile_close_group"
// CHECK: warp.library_call "warp_tile_await_groups"
// CHECK-NEXT: warp.barrier
// CHECK: warp.library_call "warp_tile_factor_16"
func.func @factor(%a: !warp.array<2 x f32>, %x: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64,
                warp.variant = #gpu} {
  %c0 = warp.constant 0 : si32
  %m = warp.tile_load %a[%c0, %c0] : !warp.array<2 x f32>, (si32, si32)
    -> !warp.tile<32x32 x f32>
  %l = warp.tile_cholesky %m : !warp.tile<32x32 x f32>
  %v = warp.tile_load %x[%c0] : !warp.array<1 x f32>, (si32)
    -> !warp.tile<32 x f32>
  %s = warp.tile_solve %l, %v : !warp.tile<32x32 x f32>, !warp.tile<32 x f32>
  warp.tile_store %s, %x[%c0] : !warp.tile<32 x f32>, !warp.array<1 x f32>,
    (si32)
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, rank = 2>

// Rows of 10 numbers do not begin at multiples of 16 bytes.
// CHECK-LABEL: func.func @other
// CHECK-NOT: fetch
// CHECK: warp.library_call "warp_tile_factor_16"
func.func @other(%a: !warp.array<2 x f32>, %x: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64,
                warp.variant = #gpu} {
  %c0 = warp.constant 0 : si32
  %m = warp.tile_load %a[%c0, %c0] : !warp.array<2 x f32>, (si32, si32)
    -> !warp.tile<10x10 x f32>
  %v = warp.tile_load %x[%c0] : !warp.array<1 x f32>, (si32)
    -> !warp.tile<10 x f32>
  %l = warp.tile_cholesky %m : !warp.tile<10x10 x f32>
  %s = warp.tile_solve %l, %v : !warp.tile<10x10 x f32>, !warp.tile<10 x f32>
  warp.tile_store %s, %x[%c0] : !warp.tile<10 x f32>, !warp.array<1 x f32>,
    (si32)
  return
}

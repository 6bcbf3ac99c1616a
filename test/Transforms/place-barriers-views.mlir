// RUN: warp-opt %s --split-input-file --warp-place-tiles \
// RUN:   --warp-plan-tile-memory --warp-place-barriers | FileCheck %s

// Views have no memory of their own: what is read through one lies where the
// tile lies that it is of, and another thread wrote it.
// CHECK-LABEL: func.func @transposed
// CHECK: warp.tile_scan
// CHECK: warp.barrier
// CHECK-NEXT: warp.tile_store
func.func @transposed(%a: !warp.array<2 x f32>, %b: !warp.array<2 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64} {
  %c0 = warp.constant 0 : si32
  %t = warp.tile_load %a[%c0, %c0] : !warp.array<2 x f32>, (si32, si32) -> !warp.tile<8x8 x f32>
  %s = warp.tile_scan add %t : !warp.tile<8x8 x f32>
  %v = warp.tile_transpose %s, [1, 0] : !warp.tile<8x8 x f32> -> !warp.tile<8x8 x f32>
  warp.tile_store %v, %b[%c0, %c0] : !warp.tile<8x8 x f32>, !warp.array<2 x f32>, (si32, si32)
  return
}

// -----

// One element changes, then a row is read, changed and put back: each after the
// one before.
// CHECK-LABEL: func.func @row
// CHECK: warp.tile_load
// CHECK: warp.barrier
// CHECK-NEXT: warp.tile_set
// CHECK-SAME: in_place = 1
// CHECK: warp.barrier
// CHECK-NEXT: warp.tile_scan
// CHECK: warp.barrier
// CHECK-NEXT: warp.tile_insert
// CHECK-SAME: in_place = 1
// CHECK: warp.barrier
// CHECK-NEXT: warp.tile_store
func.func @row(%a: !warp.array<2 x f32>, %b: !warp.array<2 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64} {
  %c0 = warp.constant 0 : si32
  %c1 = warp.constant 1 : si32
  %x = warp.constant 2.0 : f32
  %t = warp.tile_load %a[%c0, %c0] : !warp.array<2 x f32>, (si32, si32) -> !warp.tile<8x8 x f32>
  %u = warp.tile_set add %x, %t[%c1, %c1] : f32, !warp.tile<8x8 x f32>, (si32, si32)
  %r = warp.tile_slice %u[%c1, %c0] [1, 1] : !warp.tile<8x8 x f32>, (si32, si32) -> !warp.tile<1x8 x f32>
  %m = warp.tile_scan add %r : !warp.tile<1x8 x f32>
  %w = warp.tile_insert %m, %u[%c1, %c0] [1, 1] : !warp.tile<1x8 x f32>, !warp.tile<8x8 x f32>, (si32, si32)
  warp.tile_store %w, %b[%c0, %c0] : !warp.tile<8x8 x f32>, !warp.array<2 x f32>, (si32, si32)
  return
}

// RUN: warp-opt %s --warp-plan-tile-memory | FileCheck %s

// The third tile lives when the first does no longer, and takes its place.
// CHECK-LABEL: func.func @reuse
// CHECK-SAME: warp.block_bytes = 512
// CHECK: warp.tile_scan add {{.*}}offsets = array<i64: [[FIRST:[0-9]+]]>
// CHECK: warp.tile_scan add {{.*}}offsets = array<i64: [[SECOND:[0-9]+]]>
// CHECK: warp.tile_scan add {{.*}}offsets = array<i64: [[FIRST]]>
func.func @reuse(%a: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 1 : i64} {
  %c0 = warp.constant 0 : si32
  %t = warp.tile_load %a[%c0] {warp.layout = #warp.tile_layout<storage = inlined>} : !warp.array<1 x f32>, (si32)
    -> !warp.tile<64 x f32>
  %1 = warp.tile_scan add %t : !warp.tile<64 x f32>
  %2 = warp.tile_scan add %1 : !warp.tile<64 x f32>
  %3 = warp.tile_scan add %2 : !warp.tile<64 x f32>
  warp.tile_store %3, %a[%c0] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32)
  return
}

// RUN: warp-opt %s --warp-place-tiles | FileCheck %s

// A value that is loaded once per element, where it is used, is never kept.
// CHECK-LABEL: func.func @chain
// CHECK: warp.tile_load {{.*}} {warp.layout = #warp.tile_layout<storage = inlined>}
// CHECK: warp.tile_map
// CHECK: warp.tile_store
func.func @chain(%a: !warp.array<1 x f32>, %b: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64} {
  %c0 = warp.constant 0 : si32
  %t = warp.tile_load %a[%c0] : !warp.array<1 x f32>, (si32) -> !warp.tile<64 x f32>
  %u = warp.tile_map(%t) {
  ^bb0(%x: f32):
    %s = warp.sin(%x) : (f32) -> f32
    warp.tile_yield %s : f32
  } : (!warp.tile<64 x f32>) -> !warp.tile<64 x f32>
  warp.tile_store %u, %b[%c0] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32)
  return
}

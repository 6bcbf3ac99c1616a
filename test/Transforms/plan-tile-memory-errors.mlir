// RUN: warp-opt %s --warp-plan-tile-memory --verify-diagnostics

// expected-error @below {{tiles need 8388608 bytes of shared memory, which has 4194304; make them smaller}}
func.func @large(%a: !warp.array<2 x f32>)
    attributes {warp.kernel, warp.block_threads = 1 : i64} {
  %c0 = warp.constant 0 : si32
  // expected-note @below {{'tile(dtype=float32, shape=(1024, 1024))' needs 4194304 bytes}}
  %t = warp.tile_load %a[%c0, %c0] : !warp.array<2 x f32>, (si32, si32)
    -> !warp.tile<1024x1024 x f32>
  // expected-note @below {{'tile(dtype=float32, shape=(1024, 1024))' needs 4194304 bytes}}
  %s = warp.tile_scan add %t : !warp.tile<1024x1024 x f32>
  warp.tile_store %s, %a[%c0, %c0] : !warp.tile<1024x1024 x f32>, !warp.array<2 x f32>, (si32, si32)
  return
}

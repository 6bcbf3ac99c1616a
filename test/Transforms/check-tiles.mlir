// RUN: warp-opt %s --warp-check-tiles --verify-diagnostics

// The last index of a thread differs within a block.
func.func @divergent(%a: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64} {
  %c0 = warp.constant 0 : si32
  %i = warp.tid : si32
  // expected-note @below {{the condition}}
  %first = warp.lt(%i, %c0) : (si32, si32) -> i1
  scf.if %first {
    // expected-error @below {{all threads of a block have to come by here, but this stands under a condition that differs between them; move it out}}
    %t = warp.tile_load %a[%c0] : !warp.array<1 x f32>, (si32) -> !warp.tile<64 x f32>
    warp.tile_store %t, %a[%c0] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32)
  }
  return
}

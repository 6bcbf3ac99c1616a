// RUN: warp-opt %s --split-input-file --verify-diagnostics --warp-form-lane-loops

#cpu = #warp.variant<target = <name = "cpu", bits = 256>>

func.func @lowered(%a: !warp.array<1 x si32>)
    attributes {warp.kernel, warp.block_threads = 4 : i64, warp.variant = #cpu} {
  // expected-error @below {{expects a kernel of phase 'warp' to make loops over the threads of a block, which operation 'warp.tid' is not part of}}
  %i = warp.tid : i32
  warp.store_components(%i), %a[%i] : (i32), !warp.array<1 x si32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>>

func.func @fold(%a: !warp.array<1 x f32>, %o: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 4 : i64, warp.variant = #cpu} {
  %c0 = warp.constant 0 : si32
  %i = warp.tid : si32
  %x = warp.load %a[%i] : !warp.array<1 x f32>, si32 -> f32
  %t = warp.tile_load %a[%c0] : !warp.array<1 x f32>, (si32) -> !warp.tile<8 x f32>
  // expected-error @below {{a function of elements uses a value that differs between the threads of a block}}
  %s = warp.tile_fold %t {
  ^bb0(%p: f32, %q: f32):
    %r = warp.add(%p, %x) : (f32, f32) -> f32
    warp.tile_yield %r : f32
  } : !warp.tile<8 x f32> -> !warp.tile<1 x f32>
  warp.tile_store %s, %o[%c0] : !warp.tile<1 x f32>, !warp.array<1 x f32>, (si32)
  return
}

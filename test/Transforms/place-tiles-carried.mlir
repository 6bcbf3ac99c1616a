// RUN: warp-opt %s --split-input-file --warp-place-tiles | FileCheck %s

#gpu = #warp.variant<target = <name = "sm_90">, rank = 2>

// A loop and a branch carry an element per thread: no tile has memory.
// CHECK-LABEL: func.func @carried
// CHECK-NOT: warp.tile_empty
// CHECK: scf.for {{.*}} -> (f32)
// CHECK: scf.if {{.*}} -> (f32)
// CHECK-NOT: in_place
// CHECK: return
func.func @carried(%a: !warp.array<1 x f32>, %n: i32, %last: i32)
    attributes {warp.kernel, warp.block_threads = 32 : i64,
                warp.variant = #gpu} {
  %c0 = warp.constant 0 : si32
  %i0 = arith.constant 0 : i32
  %i1 = arith.constant 1 : i32
  %t = warp.tile_load %a[%c0] : !warp.array<1 x f32>, (si32)
    -> !warp.tile<32 x f32>
  %s = scf.for %i = %i0 to %n step %i1 iter_args(%all = %t)
      -> (!warp.tile<32 x f32>) : i32 {
    %isLast = arith.cmpi eq, %i, %last : i32
    %x = scf.if %isLast -> (!warp.tile<32 x f32>) {
      %q = warp.tile_map(%all, %all) {
      ^bb0(%x: f32, %y: f32):
        %z = warp.mul(%x, %y) : (f32, f32) -> f32
        warp.tile_yield %z : f32
      } : (!warp.tile<32 x f32>, !warp.tile<32 x f32>) -> !warp.tile<32 x f32>
      scf.yield %q : !warp.tile<32 x f32>
    } else {
      scf.yield %all : !warp.tile<32 x f32>
    }
    scf.yield %x : !warp.tile<32 x f32>
  }
  warp.tile_store %s, %a[%c0] : !warp.tile<32 x f32>, !warp.array<1 x f32>,
    (si32)
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, rank = 2>

// Threads that read elements of others keep the tile.
// CHECK-LABEL: func.func @others
// CHECK: scf.if {{.*}} -> (!warp.tile<32 x f32>)
func.func @others(%a: !warp.array<1 x f32>, %c: i1)
    attributes {warp.kernel, warp.block_threads = 32 : i64,
                warp.variant = #gpu} {
  %c0 = warp.constant 0 : si32
  %t = warp.tile_load %a[%c0] : !warp.array<1 x f32>, (si32)
    -> !warp.tile<32 x f32>
  %x = scf.if %c -> (!warp.tile<32 x f32>) {
    %q = warp.tile_load %a[%c0] : !warp.array<1 x f32>, (si32)
      -> !warp.tile<32 x f32>
    scf.yield %q : !warp.tile<32 x f32>
  } else {
    scf.yield %t : !warp.tile<32 x f32>
  }
  %v = warp.tile_get %x[%c0] : !warp.tile<32 x f32>, (si32) -> f32
  warp.store %v, %a[%c0] : f32, !warp.array<1 x f32>, si32
  return
}

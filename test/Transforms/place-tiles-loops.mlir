// RUN: warp-opt %s --warp-place-tiles | FileCheck %s

// A sum that a loop carries grows where it is, without a copy.
// CHECK-LABEL: func.func @accumulate
// CHECK: scf.for {{.*}} iter_args(%[[SUM:.*]] = %{{.*}})
// CHECK: %[[NEXT:.*]] = warp.tile_matmul {{.*}} add %[[SUM]] {{.*}}in_place = 2
// CHECK-NEXT: scf.yield %[[NEXT]]
func.func @accumulate(%a: !warp.array<2 x f32>, %c: !warp.array<2 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64} {
  %c0 = warp.constant 0 : si32
  %zero = warp.constant 0.0 : f32
  %lo = arith.constant 0 : i32
  %hi = arith.constant 4 : i32
  %one = arith.constant 1 : i32
  %t = warp.tile_load %a[%c0, %c0] : !warp.array<2 x f32>, (si32, si32)
    -> !warp.tile<8x8 x f32>
  %z = warp.tile_splat %zero : f32 -> !warp.tile<8x8 x f32>
  %r = scf.for %i = %lo to %hi step %one iter_args(%s = %z)
      -> (!warp.tile<8x8 x f32>) : i32 {
    %n = warp.tile_matmul %t, %t add %s : !warp.tile<8x8 x f32>,
      !warp.tile<8x8 x f32> add !warp.tile<8x8 x f32> -> !warp.tile<8x8 x f32>
    scf.yield %n : !warp.tile<8x8 x f32>
  }
  warp.tile_store %r, %c[%c0, %c0] : !warp.tile<8x8 x f32>, !warp.array<2 x f32>, (si32, si32)
  return
}

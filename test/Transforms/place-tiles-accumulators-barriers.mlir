// RUN: warp-opt %s --warp-place-tiles --warp-plan-tile-memory \
// RUN:   --warp-place-barriers | FileCheck %s

#gpu = #warp.variant<target = <name = "sm_90">, rank = 2>

// Sums lie otherwise among threads than the elements that they treat in loops,
// so threads wait between the copy of sums and a function of its elements.
// CHECK-LABEL: func.func @copied
// CHECK: %[[SUMS:.*]] = scf.for
// CHECK: warp.tile_matmul {{.*}}storage = accumulators
// CHECK: %[[COPY:.*]] = warp.tile_map(%[[SUMS]])
// CHECK: warp.barrier
// CHECK: warp.tile_store
func.func @copied(%a: !warp.array<2 x f32>, %c: !warp.array<2 x f32>)
    attributes {warp.kernel, warp.block_threads = 64 : i64,
                warp.variant = #gpu} {
  %c0 = warp.constant 0 : si32
  %none = warp.constant 0.0 : f32
  %sums = warp.tile_splat %none : f32 -> !warp.tile<32x32 x f32>
  %i0 = arith.constant 0 : i32
  %i1 = arith.constant 1 : i32
  %i8 = arith.constant 8 : i32
  %t = scf.for %i = %i0 to %i8 step %i1 iter_args(%s = %sums)
      -> (!warp.tile<32x32 x f32>) : i32 {
    %x = warp.tile_load %a[%c0, %c0] : !warp.array<2 x f32>, (si32, si32)
      -> !warp.tile<32x32 x f32>
    %p = warp.tile_matmul %x, %x add %s : !warp.tile<32x32 x f32>,
      !warp.tile<32x32 x f32> add !warp.tile<32x32 x f32>
      -> !warp.tile<32x32 x f32>
    scf.yield %p : !warp.tile<32x32 x f32>
  }
  %u = warp.tile_map(%t) {
  ^bb0(%e: f32):
    %s = warp.sin(%e) : (f32) -> f32
    warp.tile_yield %s : f32
  } : (!warp.tile<32x32 x f32>) -> !warp.tile<32x32 x f32>
  warp.tile_store %u, %c[%c0, %c0] : !warp.tile<32x32 x f32>,
    !warp.array<2 x f32>, (si32, si32)
  return
}

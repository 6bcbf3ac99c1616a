// RUN: warp-opt %s --warp-place-tiles --warp-plan-tile-memory --warp-place-barriers --warp-lower-tiles | FileCheck %s

#gpu = #warp.variant<target = <name = "sm_90">, rank = 2>

// 100 elements for 32 threads, which may be beyond the array one by one: those
// of a thread are on their way before the first is stored, and four threads
// have one more.
// CHECK-LABEL: func.func @picked
// CHECK: %[[A:.*]] = scf.if %{{.*}} -> (f32)
// CHECK: warp.load %
// CHECK: %[[B:.*]] = scf.if %{{.*}} -> (f32)
// CHECK: warp.load %
// CHECK: %[[C:.*]] = scf.if %{{.*}} -> (f32)
// CHECK: warp.load %
// CHECK-NOT: scf.if
// CHECK: warp.store %[[A]],
// CHECK: warp.store %[[B]],
// CHECK: warp.store %[[C]],
// CHECK: %[[FOUR:.*]] = arith.constant 4 : i32
// CHECK: arith.cmpi slt, %{{.*}}, %[[FOUR]]
// CHECK: scf.if
// CHECK: warp.barrier
func.func @picked(%a: !warp.array<1 x f32>, %p: !warp.array<1 x si32>,
                  %x: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64,
                warp.variant = #gpu} {
  %c0 = warp.constant 0 : si32
  %c3 = warp.constant 3 : si32
  %i = warp.tile_load %p[%c0] : !warp.array<1 x si32>, (si32)
    -> !warp.tile<100 x si32>
  %v = warp.tile_load %a[%c0] picked %i : !warp.array<1 x f32>, (si32),
    !warp.tile<100 x si32> -> !warp.tile<100 x f32>
  %one = warp.tile_get %v[%c3] : !warp.tile<100 x f32>, (si32) -> f32
  warp.store %one, %x[%c3] : f32, !warp.array<1 x f32>, si32
  warp.tile_store %v, %x[%c0] : !warp.tile<100 x f32>, !warp.array<1 x f32>,
    (si32)
  return
}

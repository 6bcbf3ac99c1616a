// RUN: warp-opt %s --warp-lower-tiles | FileCheck %s

// Thread t has elements t, t + 32, ..., as many as others; one test decides whether each access is
// tested.
// CHECK-LABEL: func.func @load
// CHECK: %[[THREAD:.*]] = warp.thread_number
// CHECK: %[[MEMORY:.*]] = warp.array_at
// CHECK: scf.if
// CHECK: scf.for %[[TURN:.*]] = %{{.*}} to %{{.*}}
// CHECK: %[[DISTANCE:.*]] = arith.muli %[[TURN]]
// CHECK: arith.addi %[[DISTANCE]], %[[THREAD]]
// CHECK-NOT: scf.if
// CHECK: warp.load
// CHECK: warp.store %{{.*}}, %[[MEMORY]]
// CHECK: else
// CHECK: scf.if
// CHECK-NOT: tile
func.func @load(%a: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64} {
  %c0 = warp.constant 0 : si32
  %t = warp.tile_load %a[%c0] {offsets = array<i64: 0>} : !warp.array<1 x f32>, (si32)
    -> !warp.tile<64 x f32>
  %x = warp.tile_get %t[%c0] : !warp.tile<64 x f32>, (si32) -> f32
  warp.store %x, %a[%c0] : f32, !warp.array<1 x f32>, si32
  return
}

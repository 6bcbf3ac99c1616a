// RUN: warp-opt %s --warp-place-tiles --warp-plan-tile-memory \
// RUN:   --warp-place-barriers --warp-lower-tiles | FileCheck %s

#gpu = #warp.variant<target = <name = "sm_90">, rank = 2>
!S = !warp.struct<"S", {n: si32, v: !warp.vec<3 x f32>}>

// A thread stores or updates its part of an element, and no other.
// CHECK-LABEL: func.func @parts
// CHECK: %[[V:.*]] = warp.component_view %[[TILE:.*]][] field "v"
// CHECK: %[[X:.*]] = warp.component_view %[[V]][%[[K:.*]]]
// CHECK: warp.store %{{.*}}, %[[X]]
// CHECK: %[[N:.*]] = warp.component_view %[[TILE]][] field "n"
// CHECK: warp.atomic add %{{.*}}, %[[N]]
func.func @parts(%x: f32, %n: si32, %k: si32, %a: !warp.array<1 x !S>)
    attributes {warp.kernel, warp.block_threads = 32 : i64, warp.variant = #gpu} {
  %c0 = warp.constant 0 : si32
  %i:2 = warp.tid : si32, si32
  %t = warp.tile_load %a[%c0] : !warp.array<1 x !S>, (si32) -> !warp.tile<32 x !S>
  %u = warp.tile_set assign %x, %t[%i#1] part ["v", 1][%k] : f32, !warp.tile<32 x !S>, (si32), (si32)
  %v = warp.tile_set add %n, %u[%i#1] part ["n"][] : si32, !warp.tile<32 x !S>, (si32)
  warp.tile_store %v, %a[%c0] : !warp.tile<32 x !S>, !warp.array<1 x !S>, (si32)
  return
}

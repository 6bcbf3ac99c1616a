// RUN: warp-opt %s --split-input-file --warp-place-tiles --warp-plan-tile-memory --warp-place-barriers --warp-lower-tiles | FileCheck %s

#cpu = #warp.variant<target = <name = "cpu", bits = 512>, rank = 1>
// CHECK-DAG: #[[UNROLL:.*]] = #llvm.loop_unroll<disable = true>
// CHECK-DAG: #[[ROLLED:.*]] = #llvm.loop_annotation<unroll = #[[UNROLL]]>

// The loop over neighbours in memory stays one, so that it becomes vectors; the
// one around it is nobody's business, and so is a loop of a few elements.
// CHECK-LABEL: func.func @rows
// CHECK: scf.if
// CHECK: scf.for
// CHECK: scf.for
// CHECK: warp.store
// CHECK: } {loop_annotation = #[[ROLLED]]}
// CHECK-NEXT: }
// CHECK: else
func.func @rows(%a: !warp.array<2 x f32>, %b: !warp.array<2 x f32>)
    attributes {warp.kernel, warp.block_threads = 1 : i64,
                warp.variant = #cpu} {
  %c0 = warp.constant 0 : si32
  %m = warp.tile_load %a[%c0, %c0] : !warp.array<2 x f32>, (si32, si32)
    -> !warp.tile<32x32 x f32>
  warp.tile_store %m, %b[%c0, %c0] : !warp.tile<32x32 x f32>,
    !warp.array<2 x f32>, (si32, si32)
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 512>, rank = 1>
// CHECK-LABEL: func.func @few
// CHECK: scf.if
// CHECK-NOT: loop_annotation
// CHECK: else
func.func @few(%a: !warp.array<2 x f32>, %b: !warp.array<2 x f32>)
    attributes {warp.kernel, warp.block_threads = 1 : i64,
                warp.variant = #cpu} {
  %c0 = warp.constant 0 : si32
  %m = warp.tile_load %a[%c0, %c0] : !warp.array<2 x f32>, (si32, si32)
    -> !warp.tile<32x4 x f32>
  warp.tile_store %m, %b[%c0, %c0] : !warp.tile<32x4 x f32>,
    !warp.array<2 x f32>, (si32, si32)
  return
}

// RUN: warp-opt %s --warp-scalarize-tiles --split-input-file | FileCheck %s

#cpu = #warp.variant<target = <name = "cpu", bits = 256>>

// A sum over threads of a block that has one, and its place in an array.
// CHECK-LABEL: func.func @loss
// CHECK-NOT: warp.block_threads
// CHECK-NOT: tile
// CHECK: %[[X:.*]] = warp.load %arg0
// CHECK: %[[SQUARE:.*]] = warp.mul(%[[X]], %[[X]])
// CHECK: %[[EXTENT:.*]] = warp.dim %arg1, 0
// CHECK: arith.cmpi ult
// CHECK: scf.if
// CHECK-NEXT: warp.atomic add %[[SQUARE]], %arg1
// CHECK-NOT: tile
func.func @loss(%x: !warp.array<1 x f32>, %sum: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 1 : i64,
                warp.variant = #cpu} {
  %i = warp.tid : si32
  %zero = warp.constant 0 : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %t = warp.tile_from_threads %v : f32 -> !warp.tile<1 x f32>
  %squares = warp.tile_map(%t, %t) {
  ^bb0(%a: f32, %b: f32):
    %p = warp.mul(%a, %b) : (f32, f32) -> f32
    warp.tile_yield %p : f32
  } : (!warp.tile<1 x f32>, !warp.tile<1 x f32>) -> !warp.tile<1 x f32>
  %s = warp.tile_reduce add %squares : !warp.tile<1 x f32> -> !warp.tile<1 x f32>
  %old = warp.tile_atomic add %s, %sum[%zero] : !warp.tile<1 x f32>, !warp.array<1 x f32>, (si32) -> !warp.tile<1 x f32>
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>>

// Outside of the array a load gives zero and a store does nothing; what is
// promised to be inside is not tested.
// CHECK-LABEL: func.func @edges
// CHECK: %[[INSIDE:.*]] = arith.cmpi ult
// CHECK: %[[V:.*]] = scf.if %[[INSIDE]] -> (f32) {
// CHECK: warp.load %arg0
// CHECK: } else {
// CHECK: warp.constant 0.0
// CHECK-NOT: scf.if
// CHECK: warp.store %[[V]], %arg0
func.func @edges(%x: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 1 : i64,
                warp.variant = #cpu} {
  %i = warp.tid : si32
  %t = warp.tile_load %x[%i] : !warp.array<1 x f32>, (si32) -> !warp.tile<1 x f32>
  %v = warp.tile_to_threads %t : !warp.tile<1 x f32> -> f32
  %u = warp.tile_splat %v : f32 -> !warp.tile<1 x f32>
  warp.tile_store %u, %x[%i] {checked = false} : !warp.tile<1 x f32>, !warp.array<1 x f32>, (si32)
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>>

// One tile of more elements, and all stay.
// CHECK-LABEL: func.func @row
// CHECK-SAME: warp.block_threads = 1
// CHECK: warp.tile_load
// CHECK: warp.tile_reduce
func.func @row(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 1 : i64,
                warp.variant = #cpu} {
  %i = warp.tid : si32
  %t = warp.tile_load %x[%i] : !warp.array<1 x f32>, (si32) -> !warp.tile<8 x f32>
  %s = warp.tile_reduce add %t : !warp.tile<8 x f32> -> !warp.tile<1 x f32>
  warp.tile_store %s, %y[%i] : !warp.tile<1 x f32>, !warp.array<1 x f32>, (si32)
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">>

// On a GPU a block of one thread is a block.
// CHECK-LABEL: func.func @gpu
// CHECK-SAME: warp.block_threads = 1
// CHECK: warp.tile_from_threads
func.func @gpu(%x: f32, %y: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 1 : i64,
                warp.variant = #gpu} {
  %i = warp.tid : si32
  %t = warp.tile_from_threads %x : f32 -> !warp.tile<1 x f32>
  warp.tile_store %t, %y[%i] : !warp.tile<1 x f32>, !warp.array<1 x f32>, (si32)
  return
}

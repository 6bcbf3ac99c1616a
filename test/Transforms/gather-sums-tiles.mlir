// RUN: warp-opt %s --split-input-file --warp-gather-sums --canonicalize --cse | FileCheck %s

// The block of a tile collects the terms that all blocks of a row add to it: a
// sum over blocks in place of one over the depth. Where there are more blocks
// than steps, several share a sum; else a tile is one block's. The cotangent is
// zeroed afterwards.
// CHECK-LABEL: func.func @product_sums
// CHECK-SAME: %[[B:.*]]: !warp.array<2 x f32>, %[[C:.*]]: !warp.array<2 x f32>, %[[A:.*]]: !warp.array<2 x f32>, %{{.*}}: si32, %[[J:.*]]: si32, %{{.*}}: si32)
// CHECK-SAME: warp.block_threads = 64 : i64, warp.halo = array<i64: 0, 0, 0>
// CHECK: %[[TID:.*]]:2 = warp.tid
// CHECK: %[[BLOCKS:.*]] = warp.cast %[[J]] : si32 to i32
// CHECK: %[[PARTS:.*]] = arith.maxui
// CHECK: %[[FIRST:.*]] = warp.cast %[[TID]]#1 : si32 to i32
// CHECK: scf.for %[[ITEM:.*]] = %[[FIRST]] to %{{.*}} step %[[BLOCKS]]
// CHECK: %[[STEP:.*]] = arith.remui %[[ITEM]]
// CHECK: %[[PART:.*]] = arith.divui %[[ITEM]]
// CHECK: %[[SUM:.*]] = scf.for %[[L:.*]] = %[[PART]] to %[[BLOCKS]] step %[[PARTS]] iter_args(%[[S:.*]] = %{{.*}})
// CHECK: %[[LS:.*]] = warp.cast %[[L]] : i32 to si32
// CHECK: %[[G:.*]] = warp.tile_load %{{.*}}[%{{.*}}, %[[LJ:.*]]] : !warp.array<2 x f32>
// CHECK: %[[Y:.*]] = warp.tile_load %[[B]][%{{.*}}, %[[LJ]]]
// CHECK: %[[T:.*]] = warp.tile_matmul %[[G]], %[[Y]] transposed add %[[S]]
// CHECK: scf.yield %[[T]]
// CHECK: %[[DA:.*]] = warp.grad %[[A]]
// CHECK: scf.if
// CHECK: warp.tile_atomic add %[[SUM]], %[[DA]]{{.*}}warp.disjoint
// CHECK: else
// CHECK: warp.tile_atomic add %[[SUM]], %[[DA]]
// CHECK-NOT: warp.disjoint
// CHECK-NOT: warp.tile_store
// CHECK-LABEL: func.func @product(
// CHECK-NOT: warp.tile_matmul
// CHECK: warp.tile_store
func.func @product(%b: !warp.array<2 x f32>, %c: !warp.array<2 x f32>,
                   %a: !warp.array<2 x f32>)
    attributes {warp.kernel, warp.block_threads = 64 : i64} {
  %none = warp.constant 0.0 : f32
  %size = warp.constant 16 : si32
  %i0 = arith.constant 0 : i32
  %i1 = arith.constant 1 : i32
  %i8 = arith.constant 8 : i32
  %dc = warp.grad %c : !warp.array<2 x f32> -> !warp.array<2 x f32>
  %da = warp.grad %a : !warp.array<2 x f32> -> !warp.array<2 x f32>
  %t:2 = warp.tid : si32, si32
  %row = warp.mul(%t#0, %size) : (si32, si32) -> si32
  %column = warp.mul(%t#1, %size) : (si32, si32) -> si32
  %g = warp.tile_load %dc[%row, %column] : !warp.array<2 x f32>, (si32, si32)
    -> !warp.tile<16x16 x f32>
  %zero = warp.tile_splat %none : f32 -> !warp.tile<16x16 x f32>
  warp.tile_store %zero, %dc[%row, %column] : !warp.tile<16x16 x f32>,
    !warp.array<2 x f32>, (si32, si32)
  scf.for %i = %i0 to %i8 step %i1 : i32 {
    %s = warp.cast %i : i32 to si32
    %k = warp.mul(%s, %size) : (si32, si32) -> si32
    %y = warp.tile_load %b[%k, %column] : !warp.array<2 x f32>, (si32, si32)
      -> !warp.tile<16x16 x f32>
    %p = warp.tile_matmul %g, %y transposed : !warp.tile<16x16 x f32>,
      !warp.tile<16x16 x f32> -> !warp.tile<16x16 x f32>
    %old = warp.tile_atomic add %p, %da[%row, %k] : !warp.tile<16x16 x f32>,
      !warp.array<2 x f32>, (si32, si32) -> !warp.tile<16x16 x f32>
  }
  return
}

// -----

// Blocks have cotangents in common, as the offset does not grow by the extent of
// a tile: who comes first takes them.
// CHECK-NOT: _sums
// CHECK-LABEL: func.func @overlapping(
// CHECK: warp.tile_matmul
func.func @overlapping(%b: !warp.array<2 x f32>, %c: !warp.array<2 x f32>,
                       %a: !warp.array<2 x f32>)
    attributes {warp.kernel, warp.block_threads = 64 : i64} {
  %none = warp.constant 0.0 : f32
  %size = warp.constant 8 : si32
  %i0 = arith.constant 0 : i32
  %i1 = arith.constant 1 : i32
  %i8 = arith.constant 8 : i32
  %dc = warp.grad %c : !warp.array<2 x f32> -> !warp.array<2 x f32>
  %da = warp.grad %a : !warp.array<2 x f32> -> !warp.array<2 x f32>
  %t:2 = warp.tid : si32, si32
  %row = warp.mul(%t#0, %size) : (si32, si32) -> si32
  %column = warp.mul(%t#1, %size) : (si32, si32) -> si32
  %g = warp.tile_load %dc[%row, %column] : !warp.array<2 x f32>, (si32, si32)
    -> !warp.tile<16x16 x f32>
  %zero = warp.tile_splat %none : f32 -> !warp.tile<16x16 x f32>
  warp.tile_store %zero, %dc[%row, %column] : !warp.tile<16x16 x f32>,
    !warp.array<2 x f32>, (si32, si32)
  scf.for %i = %i0 to %i8 step %i1 : i32 {
    %s = warp.cast %i : i32 to si32
    %k = warp.mul(%s, %size) : (si32, si32) -> si32
    %y = warp.tile_load %b[%k, %column] : !warp.array<2 x f32>, (si32, si32)
      -> !warp.tile<16x16 x f32>
    %p = warp.tile_matmul %g, %y transposed : !warp.tile<16x16 x f32>,
      !warp.tile<16x16 x f32> -> !warp.tile<16x16 x f32>
    %old = warp.tile_atomic add %p, %da[%row, %k] : !warp.tile<16x16 x f32>,
      !warp.array<2 x f32>, (si32, si32) -> !warp.tile<16x16 x f32>
  }
  return
}

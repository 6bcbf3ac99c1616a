// RUN: warp-opt %s --split-input-file --warp-place-tiles | FileCheck %s

// A tile that one branch changes, and the other gives as it is, stays where it
// is: nothing is copied. So in a loop that carries it on.
// CHECK-LABEL: func.func @border
// CHECK-NOT: warp.tile_empty
// CHECK: scf.for {{.*}} iter_args(%[[ALL:.*]] = %{{.*}})
// CHECK: scf.if
// CHECK: warp.tile_insert {{.*}}, %[[ALL]]{{.*}}{in_place = 1 : i64}
// CHECK-NEXT: scf.yield
// CHECK-NEXT: } else {
// CHECK-NEXT: scf.yield %[[ALL]]
// CHECK-NOT: warp.tile_map
// CHECK: return
func.func @border(%a: !warp.array<1 x f32>, %n: i32, %last: i32)
    attributes {warp.kernel, warp.block_threads = 32 : i64} {
  %c0 = warp.constant 0 : si32
  %i0 = arith.constant 0 : i32
  %i1 = arith.constant 1 : i32
  %t = warp.tile_load %a[%c0] : !warp.array<1 x f32>, (si32)
    -> !warp.tile<64 x f32>
  %s = scf.for %i = %i0 to %n step %i1 iter_args(%all = %t)
      -> (!warp.tile<64 x f32>) : i32 {
    %isLast = arith.cmpi eq, %i, %last : i32
    %x = scf.if %isLast -> (!warp.tile<64 x f32>) {
      %p = warp.tile_load %a[%c0] : !warp.array<1 x f32>, (si32)
        -> !warp.tile<8 x f32>
      %q = warp.tile_insert %p, %all[%c0] [1] : !warp.tile<8 x f32>,
        !warp.tile<64 x f32>, (si32)
      scf.yield %q : !warp.tile<64 x f32>
    } else {
      scf.yield %all : !warp.tile<64 x f32>
    }
    scf.yield %x : !warp.tile<64 x f32>
  }
  warp.tile_store %s, %a[%c0] : !warp.tile<64 x f32>, !warp.array<1 x f32>,
    (si32)
  return
}

// -----

// A tile that is read behind the branches keeps its elements: the branch changes a
// copy.
// CHECK-LABEL: func.func @read_behind
// CHECK: warp.tile_empty
// CHECK: scf.if
// CHECK: warp.tile_insert %{{.*}}, %{{.*}}[%{{.*}}] [1] :
func.func @read_behind(%a: !warp.array<1 x f32>, %c: i1)
    attributes {warp.kernel, warp.block_threads = 32 : i64} {
  %c0 = warp.constant 0 : si32
  %t = warp.tile_load %a[%c0] : !warp.array<1 x f32>, (si32)
    -> !warp.tile<64 x f32>
  %p = warp.tile_load %a[%c0] : !warp.array<1 x f32>, (si32)
    -> !warp.tile<8 x f32>
  %x = scf.if %c -> (!warp.tile<64 x f32>) {
    %q = warp.tile_insert %p, %t[%c0] [1] : !warp.tile<8 x f32>,
      !warp.tile<64 x f32>, (si32)
    scf.yield %q : !warp.tile<64 x f32>
  } else {
    scf.yield %t : !warp.tile<64 x f32>
  }
  warp.tile_store %x, %a[%c0] : !warp.tile<64 x f32>, !warp.array<1 x f32>,
    (si32)
  warp.tile_store %t, %a[%c0] : !warp.tile<64 x f32>, !warp.array<1 x f32>,
    (si32)
  return
}

// -----

// Two results cannot both be the tile: one is a copy.
// CHECK-LABEL: func.func @twice
// CHECK: warp.tile_empty
// CHECK: scf.if
// CHECK: warp.tile_map(%[[T:.*]], %
// CHECK: scf.yield %{{.*}}, %[[T]]
func.func @twice(%a: !warp.array<1 x f32>, %c: i1)
    attributes {warp.kernel, warp.block_threads = 32 : i64} {
  %c0 = warp.constant 0 : si32
  %t = warp.tile_load %a[%c0] : !warp.array<1 x f32>, (si32)
    -> !warp.tile<64 x f32>
  %x:2 = scf.if %c -> (!warp.tile<64 x f32>, !warp.tile<64 x f32>) {
    scf.yield %t, %t : !warp.tile<64 x f32>, !warp.tile<64 x f32>
  } else {
    scf.yield %t, %t : !warp.tile<64 x f32>, !warp.tile<64 x f32>
  }
  warp.tile_store %x#0, %a[%c0] : !warp.tile<64 x f32>, !warp.array<1 x f32>,
    (si32)
  warp.tile_store %x#1, %a[%c0] : !warp.tile<64 x f32>, !warp.array<1 x f32>,
    (si32)
  return
}

// RUN: warp-opt %s --split-input-file --warp-lower-tiles | FileCheck %s

#gpu = #warp.variant<target = <platform = cuda, version = 90>, rank = 2, disjoint = true>

// Blocks have windows side by side and the threads of the last dimension: if the
// launch says so and the window is inside of the array, sums are plain, and all
// elements of a thread are loaded before one is stored.
// CHECK-LABEL: func.func @own
// CHECK: %[[FIRST:.*]] = warp.launch_extent 0
// CHECK: arith.cmpi sle, %[[FIRST]]
// CHECK: %[[THREADS:.*]] = warp.launch_extent 1
// CHECK: arith.cmpi eq, %[[THREADS]]
// CHECK: scf.if
// CHECK: warp.load
// CHECK: warp.load
// CHECK: warp.store
// CHECK: warp.store
// CHECK-NOT: warp.atomic
// CHECK: else
// CHECK: scf.if
// CHECK: warp.atomic add
// CHECK-NOT: warp.store
func.func @own(%a: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64,
                warp.variant = #gpu} {
  %size = warp.constant 64 : si32
  %one = warp.constant 1.0 : f32
  %i = warp.tid : si32
  %first = warp.mul(%i, %size) : (si32, si32) -> si32
  %t = warp.tile_splat %one {placement = "inline"} : f32 -> !warp.tile<64 x f32>
  %old = warp.tile_atomic add %t, %a[%first] {offsets = array<i64: 0>}
    : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32) -> !warp.tile<64 x f32>
  return
}

// -----

#gpu = #warp.variant<target = <platform = cuda, version = 90>, rank = 2, disjoint = true>

// Windows overlap.
// CHECK-LABEL: func.func @shared
// CHECK-NOT: warp.launch_extent
// CHECK: warp.atomic add
func.func @shared(%a: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64,
                warp.variant = #gpu} {
  %size = warp.constant 63 : si32
  %one = warp.constant 1.0 : f32
  %i = warp.tid : si32
  %first = warp.mul(%i, %size) : (si32, si32) -> si32
  %t = warp.tile_splat %one {placement = "inline"} : f32 -> !warp.tile<64 x f32>
  %old = warp.tile_atomic add %t, %a[%first] {offsets = array<i64: 0>}
    : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32) -> !warp.tile<64 x f32>
  return
}

// -----

#exact = #warp.variant<target = <platform = cuda, version = 90>, rank = 2, disjoint = true, deterministic = exact>

// Exact sums are made in memory of their own, so that no update is plain.
// CHECK-LABEL: func.func @exact
// CHECK-NOT: warp.launch_extent
// CHECK: warp.atomic add
// CHECK-NOT: warp.store
func.func @exact(%a: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64,
                warp.variant = #exact} {
  %size = warp.constant 64 : si32
  %one = warp.constant 1.0 : f32
  %i = warp.tid : si32
  %first = warp.mul(%i, %size) : (si32, si32) -> si32
  %t = warp.tile_splat %one {placement = "inline"} : f32 -> !warp.tile<64 x f32>
  %old = warp.tile_atomic add %t, %a[%first] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32) -> !warp.tile<64 x f32>
  return
}

// RUN: warp-opt %s --split-input-file --warp-lower-tiles | FileCheck %s

#gpu = #warp.variant<target = <name = "sm_90">, rank = 2, disjoint = true>

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
  %t = warp.tile_splat %one {warp.layout = #warp.tile_layout<storage = inlined>} : f32 -> !warp.tile<64 x f32>
  %old = warp.tile_atomic add %t, %a[%first] {offsets = array<i64: 0>}
    : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32) -> !warp.tile<64 x f32>
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, rank = 2, disjoint = true>

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
  %t = warp.tile_splat %one {warp.layout = #warp.tile_layout<storage = inlined>} : f32 -> !warp.tile<64 x f32>
  %old = warp.tile_atomic add %t, %a[%first] {offsets = array<i64: 0>}
    : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32) -> !warp.tile<64 x f32>
  return
}

// -----

#exact = #warp.variant<target = <name = "sm_90">, rank = 2, disjoint = true, deterministic = true>

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
  %t = warp.tile_splat %one {warp.layout = #warp.tile_layout<storage = inlined>} : f32 -> !warp.tile<64 x f32>
  %old = warp.tile_atomic add %t, %a[%first] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32) -> !warp.tile<64 x f32>
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, rank = 2, disjoint = true>

// Values that other threads of the block have stored are loaded behind the
// barrier that orders both, and before what comes after it.
// CHECK-LABEL: func.func @behind_barrier
// CHECK: warp.store
// CHECK-NOT: warp.load %arg0
// CHECK: warp.barrier
// CHECK: warp.store %{{.*}}, %arg1
// CHECK: warp.load %arg0
// CHECK: warp.barrier
// CHECK: warp.store %{{.*}}, %arg0
func.func @behind_barrier(%a: !warp.array<1 x f32>, %b: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64,
                warp.variant = #gpu} {
  %size = warp.constant 32 : si32
  %one = warp.constant 1.0 : f32
  %i = warp.tid : si32
  %first = warp.mul(%i, %size) : (si32, si32) -> si32
  %t = warp.tile_splat %one {warp.layout = #warp.tile_layout<storage = inlined>} : f32 -> !warp.tile<32 x f32>
  warp.tile_store %t, %a[%first] : !warp.tile<32 x f32>, !warp.array<1 x f32>, (si32)
  warp.barrier
  warp.tile_store %t, %b[%first] : !warp.tile<32 x f32>, !warp.array<1 x f32>, (si32)
  warp.barrier
  %old = warp.tile_atomic add %t, %a[%first] : !warp.tile<32 x f32>, !warp.array<1 x f32>, (si32) -> !warp.tile<32 x f32>
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, rank = 2, disjoint = true>

// Also if the place is found out before the barrier.
// CHECK-LABEL: func.func @place_before_barrier
// CHECK: warp.store
// CHECK-NOT: warp.load %arg0
// CHECK: warp.barrier
// CHECK: warp.load %arg0
// CHECK: warp.barrier
// CHECK: warp.store %{{.*}}, %arg0
func.func @place_before_barrier(%a: !warp.array<1 x f32>, %b: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64,
                warp.variant = #gpu} {
  %size = warp.constant 32 : si32
  %one = warp.constant 1.0 : f32
  %i = warp.tid : si32
  %first = warp.mul(%i, %size) : (si32, si32) -> si32
  %t = warp.tile_splat %one {warp.layout = #warp.tile_layout<storage = inlined>} : f32 -> !warp.tile<32 x f32>
  warp.tile_store %t, %a[%first] : !warp.tile<32 x f32>, !warp.array<1 x f32>, (si32)
  %again = warp.mul(%i, %size) : (si32, si32) -> si32
  warp.barrier
  warp.tile_store %t, %b[%first] : !warp.tile<32 x f32>, !warp.array<1 x f32>, (si32)
  warp.barrier
  %old = warp.tile_atomic add %t, %a[%again] : !warp.tile<32 x f32>, !warp.array<1 x f32>, (si32) -> !warp.tile<32 x f32>
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, rank = 2, disjoint = true>

// A block of one thread has no threads to share elements with.
// CHECK-LABEL: func.func @one_thread
// CHECK: warp.store %{{.*}}, %arg0
func.func @one_thread(%a: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 1 : i64,
                warp.variant = #gpu} {
  %size = warp.constant 8 : si32
  %one = warp.constant 1.0 : f32
  %i = warp.tid : si32
  %first = warp.mul(%i, %size) : (si32, si32) -> si32
  %t = warp.tile_splat %one {warp.layout = #warp.tile_layout<storage = inlined>} : f32 -> !warp.tile<8 x f32>
  %old = warp.tile_atomic add %t, %a[%first] : !warp.tile<8 x f32>, !warp.array<1 x f32>, (si32) -> !warp.tile<8 x f32>
  return
}

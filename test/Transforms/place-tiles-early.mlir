// RUN: warp-opt %s --split-input-file --warp-place-tiles | FileCheck %s
// RUN: warp-opt %s --split-input-file --warp-place-tiles --warp-plan-tile-memory \
// RUN:   --warp-place-barriers --warp-lower-tiles | FileCheck %s --check-prefix=LOOPS

#gpu = #warp.variant<target = <name = "sm_90">, rank = 2, disjoint = true>

// The result of a reduction is in a register of every thread, and loads of
// other array holds is loaded before the block computes. So is what an update
// adds to, if no other block touches it.
// CHECK-LABEL: func.func @row
// CHECK: warp.tile_load %arg0{{.*}} {warp.layout = #warp.tile_layout<storage = distributed>}
// CHECK: warp.tile_load %arg1{{.*}} {warp.layout = #warp.tile_layout<storage = distributed>}
// CHECK: warp.tile_reduce max {{.*}}storage = replicated
// CHECK: warp.tile_reduce add {{.*}}storage = replicated
// LOOPS-LABEL: func.func @row
// LOOPS: warp.launch_extent
// LOOPS: warp.load %arg2
// LOOPS: warp.library_call "warp_tile_combine_max"
// LOOPS-NOT: warp.load %arg2
// LOOPS: warp.store {{.*}}, %arg2
func.func @row(%x: !warp.array<1 x f32>, %g: !warp.array<1 x f32>, %out: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64, warp.variant = #gpu} {
  %size = warp.constant 64 : si32
  %i = warp.tid : si32
  %first = warp.mul(%i, %size) : (si32, si32) -> si32
  %t = warp.tile_load %x[%first] : !warp.array<1 x f32>, (si32) -> !warp.tile<64 x f32>
  %m = warp.tile_reduce max %t : !warp.tile<64 x f32> -> !warp.tile<1 x f32>
  %all = warp.tile_broadcast %m : !warp.tile<1 x f32> -> !warp.tile<64 x f32>
  %u = warp.tile_load %g[%first] : !warp.array<1 x f32>, (si32) -> !warp.tile<64 x f32>
  %v = warp.tile_map(%t, %all, %u) {
  ^bb0(%a: f32, %b: f32, %c: f32):
    %d = warp.sub(%a, %b) : (f32, f32) -> f32
    %e = warp.mul(%d, %c) : (f32, f32) -> f32
    warp.tile_yield %e : f32
  } : (!warp.tile<64 x f32>, !warp.tile<64 x f32>, !warp.tile<64 x f32>) -> !warp.tile<64 x f32>
  %s = warp.tile_reduce add %v : !warp.tile<64 x f32> -> !warp.tile<1 x f32>
  %sums = warp.tile_broadcast %s : !warp.tile<1 x f32> -> !warp.tile<64 x f32>
  %w = warp.tile_map(%v, %sums, %u) {
  ^bb0(%a: f32, %b: f32, %c: f32):
    %d = warp.sub(%a, %b) : (f32, f32) -> f32
    %e = warp.mul(%d, %c) : (f32, f32) -> f32
    warp.tile_yield %e : f32
  } : (!warp.tile<64 x f32>, !warp.tile<64 x f32>, !warp.tile<64 x f32>) -> !warp.tile<64 x f32>
  %old = warp.tile_atomic add %w, %out[%first] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32) -> !warp.tile<64 x f32>
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, rank = 2, disjoint = true>

// A store that clears an array comes last, but before reads of the array.
// CHECK-LABEL: func.func @cleared
// CHECK: warp.tile_load %arg1
// CHECK: warp.tile_atomic add {{.*}}, %arg0
// CHECK: warp.tile_store {{.*}}, %arg2
// CHECK-NEXT: warp.tile_load %arg2
// CHECK: warp.tile_store {{.*}}, %arg0
// CHECK-NEXT: warp.tile_store {{.*}}, %arg1
// CHECK-NEXT: return
func.func @cleared(%x: !warp.array<1 x f32>, %g: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64, warp.variant = #gpu} {
  %size = warp.constant 64 : si32
  %zero = warp.constant 0.0 : f32
  %i = warp.tid : si32
  %first = warp.mul(%i, %size) : (si32, si32) -> si32
  %none = warp.tile_splat %zero : f32 -> !warp.tile<64 x f32>
  warp.tile_store %none, %y[%first] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32)
  %t = warp.tile_load %g[%first] : !warp.array<1 x f32>, (si32) -> !warp.tile<64 x f32>
  warp.tile_store %none, %g[%first] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32)
  %old = warp.tile_atomic add %t, %x[%first] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32) -> !warp.tile<64 x f32>
  %u = warp.tile_load %y[%first] : !warp.array<1 x f32>, (si32) -> !warp.tile<64 x f32>
  %s = warp.tile_reduce add %u : !warp.tile<64 x f32> -> !warp.tile<1 x f32>
  %all = warp.tile_broadcast %s : !warp.tile<1 x f32> -> !warp.tile<64 x f32>
  warp.tile_store %all, %x[%first] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32)
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, rank = 2, disjoint = true>

// A function of elements may look at an array that has been cleared, or change
// one that is loaded behind it; what an update gives back may say that it has
// been cleared.
// CHECK-LABEL: func.func @function
// CHECK: warp.tile_store {{.*}}, %arg1
// CHECK-NEXT: warp.tile_map
// CHECK: warp.load %arg1
// CHECK: warp.tile_store {{.*}}, %arg2
// CHECK: warp.atomic add
// CHECK-NEXT: warp.store
// CHECK-NOT: warp.tile_store {{.*}}, %arg1
// CHECK: warp.tile_map
// CHECK: warp.atomic add
// CHECK: warp.tile_load %arg1{{.*}} {warp.layout = #warp.tile_layout<storage = distributed>}
func.func @function(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %z: !warp.array<1 x f32>,
                    %n: !warp.array<1 x si32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64, warp.variant = #gpu} {
  %size = warp.constant 64 : si32
  %zero = warp.constant 0.0 : f32
  %c0 = warp.constant 0 : si32
  %c1 = warp.constant 1 : si32
  %i = warp.tid : si32
  %first = warp.mul(%i, %size) : (si32, si32) -> si32
  %t = warp.tile_load %x[%first] : !warp.array<1 x f32>, (si32) -> !warp.tile<64 x f32>
  %none = warp.tile_splat %zero : f32 -> !warp.tile<64 x f32>
  warp.tile_store %none, %y[%first] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32)
  %u = warp.tile_map(%t) {
  ^bb0(%a: f32):
    %v = warp.load %y[%first] : !warp.array<1 x f32>, si32 -> f32
    %w = warp.add(%a, %v) : (f32, f32) -> f32
    warp.tile_yield %w : f32
  } : (!warp.tile<64 x f32>) -> !warp.tile<64 x f32>
  warp.tile_store %none, %z[%first] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32)
  %old = warp.atomic add %c1, %n[%c0] : si32, !warp.array<1 x si32>, si32 -> si32
  warp.store %old, %n[%i] : si32, !warp.array<1 x si32>, si32
  %k = warp.tile_map(%u) {
  ^bb0(%a: f32):
    %was = warp.atomic add %a, %y[%c0] : f32, !warp.array<1 x f32>, si32 -> f32
    warp.tile_yield %a : f32
  } : (!warp.tile<64 x f32>) -> !warp.tile<64 x f32>
  %l = warp.tile_load %y[%first] : !warp.array<1 x f32>, (si32) -> !warp.tile<64 x f32>
  %s = warp.tile_reduce add %l : !warp.tile<64 x f32> -> !warp.tile<1 x f32>
  %all = warp.tile_broadcast %s : !warp.tile<1 x f32> -> !warp.tile<64 x f32>
  %m = warp.tile_map(%k, %all, %l) {
  ^bb0(%a: f32, %b: f32, %c: f32):
    %d = warp.add(%a, %b) : (f32, f32) -> f32
    %w = warp.add(%d, %c) : (f32, f32) -> f32
    warp.tile_yield %w : f32
  } : (!warp.tile<64 x f32>, !warp.tile<64 x f32>, !warp.tile<64 x f32>) -> !warp.tile<64 x f32>
  warp.tile_store %m, %x[%first] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32)
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, rank = 2, disjoint = true>

// A load stays behind a store to the array.
// CHECK-LABEL: func.func @behind
// CHECK: warp.tile_reduce add
// CHECK: warp.tile_store {{.*}}, %arg1
// CHECK: warp.tile_load %arg1
func.func @behind(%x: !warp.array<1 x f32>, %g: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64, warp.variant = #gpu} {
  %c0 = warp.constant 0 : si32
  %c8 = warp.constant 8 : si32
  %t = warp.tile_load %x[%c0] : !warp.array<1 x f32>, (si32) -> !warp.tile<64 x f32>
  %m = warp.tile_reduce add %t : !warp.tile<64 x f32> -> !warp.tile<1 x f32>
  warp.tile_store %m, %g[%c0] : !warp.tile<1 x f32>, !warp.array<1 x f32>, (si32)
  %u = warp.tile_load %g[%c8] : !warp.array<1 x f32>, (si32) -> !warp.tile<64 x f32>
  %s = warp.tile_reduce add %u : !warp.tile<64 x f32> -> !warp.tile<1 x f32>
  %all = warp.tile_broadcast %s : !warp.tile<1 x f32> -> !warp.tile<64 x f32>
  %v = warp.tile_map(%u, %all) {
  ^bb0(%a: f32, %b: f32):
    %d = warp.sub(%a, %b) : (f32, f32) -> f32
    warp.tile_yield %d : f32
  } : (!warp.tile<64 x f32>, !warp.tile<64 x f32>) -> !warp.tile<64 x f32>
  warp.tile_store %v, %x[%c0] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32)
  return
}

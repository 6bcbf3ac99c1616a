// RUN: warp-opt %s --split-input-file --warp-place-barriers | FileCheck %s

// Elements that the same thread writes and reads need no barrier; what another
// thread may have written does.
// CHECK-LABEL: func.func @wait
// CHECK: warp.tile_load
// CHECK-NOT: warp.barrier
// CHECK: warp.tile_map
// CHECK: warp.barrier
// CHECK-NEXT: warp.tile_scan
func.func @wait(%a: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64} {
  %c0 = warp.constant 0 : si32
  %t = warp.tile_load %a[%c0] {offsets = array<i64: 0>} : !warp.array<1 x f32>, (si32)
    -> !warp.tile<64 x f32>
  %u = warp.tile_map(%t) {
  ^bb0(%x: f32):
    %s = warp.sin(%x) : (f32) -> f32
    warp.tile_yield %s : f32
  } {offsets = array<i64: 256>} : (!warp.tile<64 x f32>) -> !warp.tile<64 x f32>
  %v = warp.tile_scan add %u {offsets = array<i64: 512>, scratch = 768 : i64}
    : !warp.tile<64 x f32>
  warp.tile_store %v, %a[%c0] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32)
  return
}

// -----

#apart = #warp.variant<target = <platform = cuda, version = 90>, disjoint = true>

// What is stored does not meet what was loaded of an array that it is known not
// to overlap; of the same array it does.
// CHECK-LABEL: func.func @apart
// CHECK: warp.tile_load
// CHECK-NOT: warp.barrier
// CHECK: warp.tile_store
// CHECK: warp.barrier
// CHECK-NEXT: warp.tile_store
func.func @apart(%a: !warp.array<1 x f32>, %b: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64,
                warp.variant = #apart} {
  %c0 = warp.constant 0 : si32
  %t = warp.tile_load %a[%c0] {offsets = array<i64: 0>} : !warp.array<1 x f32>, (si32)
    -> !warp.tile<64 x f32>
  warp.tile_store %t, %b[%c0] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32)
  warp.tile_store %t, %a[%c0] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32)
  return
}


// -----

// Where the program waits already, nothing else does.
// CHECK-LABEL: func.func @waits
// CHECK: warp.tile_yield
// CHECK-NEXT: }
// CHECK-NEXT: warp.barrier
// CHECK-NEXT: warp.tile_scan
func.func @waits(%a: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64} {
  %c0 = warp.constant 0 : si32
  %t = warp.tile_load %a[%c0] {offsets = array<i64: 0>} : !warp.array<1 x f32>, (si32)
    -> !warp.tile<64 x f32>
  %u = warp.tile_map(%t) {
  ^bb0(%x: f32):
    %s = warp.sin(%x) : (f32) -> f32
    warp.tile_yield %s : f32
  } {offsets = array<i64: 256>} : (!warp.tile<64 x f32>) -> !warp.tile<64 x f32>
  warp.barrier
  %v = warp.tile_scan add %u {offsets = array<i64: 512>, scratch = 768 : i64}
    : !warp.tile<64 x f32>
  warp.tile_store %v, %a[%c0] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32)
  return
}

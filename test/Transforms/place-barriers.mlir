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

#disjoint = #warp.variant<target = <name = "sm_90">, disjoint = true>

// A store does not wait for loads of an array that it is known not
// to overlap; of the same array it does, unless every thread stores where it
// has loaded.
// CHECK-LABEL: func.func @disjoint
// CHECK: warp.tile_load
// CHECK-NOT: warp.barrier
// CHECK: warp.tile_store
// CHECK-NOT: warp.barrier
// CHECK: warp.tile_store {{.*}}, %{{.*}}[%[[SAME:.*]]]
// CHECK: warp.barrier
// CHECK-NEXT: warp.tile_store
func.func @disjoint(%a: !warp.array<1 x f32>, %b: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64,
                warp.variant = #disjoint} {
  %c0 = warp.constant 0 : si32
  %t = warp.tile_load %a[%c0] {offsets = array<i64: 0>} : !warp.array<1 x f32>, (si32)
    -> !warp.tile<64 x f32>
  warp.tile_store %t, %b[%c0] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32)
  warp.tile_store %t, %a[%c0] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32)
  %c1 = warp.constant 1 : si32
  warp.tile_store %t, %a[%c1] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32)
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

// -----

// Which rows are stored, each thread reads for all elements that it has of
// them: not the thread alone that wrote the number of the row.
// CHECK-LABEL: func.func @picked
// CHECK: warp.tile_map
// CHECK: warp.barrier
// CHECK: warp.tile_store
func.func @picked(%a: !warp.array<2 x f32>, %b: !warp.array<2 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64} {
  %c0 = warp.constant 0 : si32
  %rows = warp.tile_iota %c0, %c0 {offsets = array<i64: 0>} : si32 -> !warp.tile<64 x si32>
  %t = warp.tile_map(%rows) {
  ^bb0(%i: si32):
    %x = warp.constant 1.0 : f32
    warp.tile_yield %x : f32
  } {offsets = array<i64: 256>} : (!warp.tile<64 x si32>) -> !warp.tile<64 x f32>
  %m = warp.tile_reshape %t {warp.layout = #warp.tile_layout<storage = inlined>} : !warp.tile<64 x f32> -> !warp.tile<64x1 x f32>
  warp.tile_store %m, %a[%c0, %c0] picked %rows : !warp.tile<64x1 x f32>, !warp.array<2 x f32>, (si32, si32), !warp.tile<64 x si32>
  return
}

// -----

// Accesses of a thread by itself come after earlier accesses of the block, also
// under a condition; between threads there is no order.
// CHECK-LABEL: func.func @alone
// CHECK: warp.store
// CHECK-NEXT: warp.load
// CHECK-NOT: warp.barrier
// CHECK: warp.load
// CHECK: warp.barrier
// CHECK-NEXT: warp.tile_store
// CHECK-NEXT: warp.barrier
// CHECK-NEXT: warp.load
// CHECK: warp.barrier
// CHECK-NEXT: warp.tile_store
// CHECK-NEXT: warp.barrier
// CHECK-NEXT: scf.if
func.func @alone(%a: !warp.array<1 x f32>, %i: si32, %c: i1)
    attributes {warp.kernel, warp.block_threads = 32 : i64} {
  %c0 = warp.constant 0 : si32
  %one = warp.constant 1.0 : f32
  warp.store %one, %a[%i] : f32, !warp.array<1 x f32>, si32
  %x = warp.load %a[%i] : !warp.array<1 x f32>, si32 -> f32
  %y = warp.load %a[%c0] : !warp.array<1 x f32>, si32 -> f32
  %t = warp.tile_splat %one {warp.layout = #warp.tile_layout<storage = inlined>} : f32 -> !warp.tile<64 x f32>
  warp.tile_store %t, %a[%c0] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32)
  %z = warp.load %a[%i] : !warp.array<1 x f32>, si32 -> f32
  warp.tile_store %t, %a[%c0] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32)
  scf.if %c {
    warp.store %z, %a[%i] : f32, !warp.array<1 x f32>, si32
  }
  return
}

// RUN: warp-opt %s --warp-fuse-tiles --split-input-file | FileCheck %s
// RUN: warp-opt %s --warp-fuse-tiles --warp-place-tiles --split-input-file \
// RUN:   | FileCheck %s --check-prefix=PLACE

// Two functions of a tile that both use become one, which takes it once.
// CHECK-LABEL: func.func @chain
// CHECK: %[[T:.*]] = warp.tile_load
// CHECK: warp.tile_map(%[[T]])
// CHECK: %[[S:.*]] = warp.sin(%[[X:.*]]) :
// CHECK: warp.mul(%[[S]], %[[X]])
// CHECK-NOT: warp.tile_map
// PLACE-LABEL: func.func @chain
// PLACE: warp.tile_load {{.*}}warp.layout = #warp.tile_layout<storage = inlined>
// PLACE: } {warp.layout = #warp.tile_layout<storage = inlined>}
func.func @chain(%a: !warp.array<1 x f32>, %b: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64, warp.variant =
      #warp.variant<target = <name = "sm_90">, disjoint = true>} {
  %c0 = warp.constant 0 : si32
  %t = warp.tile_load %a[%c0] : !warp.array<1 x f32>, (si32) -> !warp.tile<64 x f32>
  %u = warp.tile_map(%t) {
  ^bb0(%x: f32):
    %s = warp.sin(%x) : (f32) -> f32
    warp.tile_yield %s : f32
  } : (!warp.tile<64 x f32>) -> !warp.tile<64 x f32>
  %v = warp.tile_map(%u, %t) {
  ^bb0(%x: f32, %y: f32):
    %s = warp.mul(%x, %y) : (f32, f32) -> f32
    warp.tile_yield %s : f32
  } : (!warp.tile<64 x f32>, !warp.tile<64 x f32>) -> !warp.tile<64 x f32>
  warp.tile_store %v, %b[%c0] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32)
  return
}

// -----

// A tile with another user stays.
// CHECK-LABEL: func.func @used_twice
// CHECK-COUNT-2: warp.tile_map
func.func @used_twice(%a: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64} {
  %c0 = warp.constant 0 : si32
  %t = warp.tile_load %a[%c0] : !warp.array<1 x f32>, (si32) -> !warp.tile<64 x f32>
  %u = warp.tile_map(%t) {
  ^bb0(%x: f32):
    %s = warp.sin(%x) : (f32) -> f32
    warp.tile_yield %s : f32
  } : (!warp.tile<64 x f32>) -> !warp.tile<64 x f32>
  %v = warp.tile_map(%u) {
  ^bb0(%x: f32):
    %s = warp.cos(%x) : (f32) -> f32
    warp.tile_yield %s : f32
  } : (!warp.tile<64 x f32>) -> !warp.tile<64 x f32>
  warp.tile_store %u, %a[%c0] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32)
  warp.tile_store %v, %a[%c0] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32)
  return
}

// -----

// A store at another place of the same array, or in another order, would write
// what is yet to be loaded; one at the same place does not.
// PLACE-LABEL: func.func @hazards
// PLACE: warp.tile_load {{.*}}] : !warp.array
// PLACE: warp.tile_store
// PLACE: warp.tile_load {{.*}}warp.layout = #warp.tile_layout<storage = inlined>
// PLACE: warp.tile_store
// PLACE: warp.tile_transpose {{.*}}, [1, 0] :
func.func @hazards(%a: !warp.array<2 x f32>)
    attributes {warp.kernel, warp.block_threads = 1 : i64} {
  %c0 = warp.constant 0 : si32
  %c1 = warp.constant 1 : si32
  %t = warp.tile_load %a[%c0, %c0] : !warp.array<2 x f32>, (si32, si32) -> !warp.tile<8x8 x f32>
  warp.tile_store %t, %a[%c1, %c1] : !warp.tile<8x8 x f32>, !warp.array<2 x f32>, (si32, si32)
  %u = warp.tile_load %a[%c1, %c0] : !warp.array<2 x f32>, (si32, si32) -> !warp.tile<8x8 x f32>
  warp.tile_store %u, %a[%c1, %c0] : !warp.tile<8x8 x f32>, !warp.array<2 x f32>, (si32, si32)
  %v = warp.tile_load %a[%c0, %c1] : !warp.array<2 x f32>, (si32, si32) -> !warp.tile<8x8 x f32>
  %w = warp.tile_transpose %v, [1, 0] : !warp.tile<8x8 x f32> -> !warp.tile<8x8 x f32>
  warp.tile_store %w, %a[%c0, %c1] : !warp.tile<8x8 x f32>, !warp.array<2 x f32>, (si32, si32)
  return
}

// -----

// Nothing says that the two arrays do not overlap.
// PLACE-LABEL: func.func @may_overlap
// PLACE: warp.tile_load {{.*}}] : !warp.array
func.func @may_overlap(%a: !warp.array<1 x f32>, %b: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64} {
  %c0 = warp.constant 0 : si32
  %t = warp.tile_load %a[%c0] : !warp.array<1 x f32>, (si32) -> !warp.tile<64 x f32>
  warp.tile_store %t, %b[%c0] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32)
  return
}

// -----

// A kept tile is read and not computed again, and the tiles it was computed
// from no longer asked for.
// CHECK-LABEL: func.func @again
// CHECK: %[[T:.*]] = warp.tile_load
// CHECK: %[[E:.*]] = warp.tile_map(%[[T]], %{{.*}}) {
// CHECK: warp.exp
// CHECK: warp.tile_reduce add %[[E]]
// CHECK: warp.tile_map(%[[E]]) {
// CHECK-NEXT: ^bb0(%[[X:.*]]: f32):
// CHECK-NEXT: warp.neg(%[[X]])
// CHECK-NEXT: warp.tile_yield
func.func @again(%a: !warp.array<1 x f32>, %b: !warp.array<1 x f32>, %m: f32)
    attributes {warp.kernel, warp.block_threads = 1 : i64} {
  %c0 = warp.constant 0 : si32
  %t = warp.tile_load %a[%c0] : !warp.array<1 x f32>, (si32) -> !warp.tile<64 x f32>
  %e = warp.tile_map(%t, %m) {
  ^bb0(%x: f32, %y: f32):
    %d = warp.sub(%x, %y) : (f32, f32) -> f32
    %s = warp.exp(%d) : (f32) -> f32
    warp.tile_yield %s : f32
  } : (!warp.tile<64 x f32>, f32) -> !warp.tile<64 x f32>
  %s = warp.tile_reduce add %e : !warp.tile<64 x f32> -> !warp.tile<1 x f32>
  warp.tile_store %s, %a[%c0] : !warp.tile<1 x f32>, !warp.array<1 x f32>, (si32)
  warp.tile_store %e, %b[%c0] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32)
  %v = warp.tile_map(%t, %m) {
  ^bb0(%x: f32, %y: f32):
    %d = warp.sub(%x, %y) : (f32, f32) -> f32
    %p = warp.exp(%d) : (f32) -> f32
    %n = warp.neg(%p) : (f32) -> f32
    warp.tile_yield %n : f32
  } : (!warp.tile<64 x f32>, f32) -> !warp.tile<64 x f32>
  warp.tile_store %v, %b[%c0] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32)
  return
}

// -----

// A tile with one use is not kept.
// CHECK-LABEL: func.func @once
// CHECK-COUNT-2: warp.exp
func.func @once(%a: !warp.array<1 x f32>, %b: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 1 : i64} {
  %c0 = warp.constant 0 : si32
  %t = warp.tile_load %a[%c0] : !warp.array<1 x f32>, (si32) -> !warp.tile<64 x f32>
  %e = warp.tile_map(%t) {
  ^bb0(%x: f32):
    %s = warp.exp(%x) : (f32) -> f32
    warp.tile_yield %s : f32
  } : (!warp.tile<64 x f32>) -> !warp.tile<64 x f32>
  %s = warp.tile_reduce add %e : !warp.tile<64 x f32> -> !warp.tile<1 x f32>
  warp.tile_store %s, %a[%c0] : !warp.tile<1 x f32>, !warp.array<1 x f32>, (si32)
  %v = warp.tile_map(%t) {
  ^bb0(%x: f32):
    %p = warp.exp(%x) : (f32) -> f32
    warp.tile_yield %p : f32
  } : (!warp.tile<64 x f32>) -> !warp.tile<64 x f32>
  warp.tile_store %v, %b[%c0] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32)
  return
}

// -----

// A product adds to the tile that it is added to; of 16 bits it is rounded
// before, and stays.
// CHECK-LABEL: func.func @added
// CHECK: warp.tile_matmul %[[X:.*]], %[[X]] add %[[X]] : {{.*}} -> !warp.tile<8x8 x f32>
// CHECK-NOT: warp.tile_map
// CHECK: warp.tile_matmul %[[H:.*]], %[[H]] :
// CHECK: warp.tile_map
func.func @added(%a: !warp.array<2 x f32>, %b: !warp.array<2 x f16>)
    attributes {warp.kernel, warp.block_threads = 32 : i64} {
  %c0 = warp.constant 0 : si32
  %x = warp.tile_load %a[%c0, %c0] : !warp.array<2 x f32>, (si32, si32) -> !warp.tile<8x8 x f32>
  %p = warp.tile_matmul %x, %x : !warp.tile<8x8 x f32>, !warp.tile<8x8 x f32> -> !warp.tile<8x8 x f32>
  %s = warp.tile_map(%x, %p) {
  ^bb0(%u: f32, %v: f32):
    %w = warp.add(%u, %v) : (f32, f32) -> f32
    warp.tile_yield %w : f32
  } : (!warp.tile<8x8 x f32>, !warp.tile<8x8 x f32>) -> !warp.tile<8x8 x f32>
  warp.tile_store %s, %a[%c0, %c0] : !warp.tile<8x8 x f32>, !warp.array<2 x f32>, (si32, si32)
  %h = warp.tile_load %b[%c0, %c0] : !warp.array<2 x f16>, (si32, si32) -> !warp.tile<8x8 x f16>
  %q = warp.tile_matmul %h, %h : !warp.tile<8x8 x f16>, !warp.tile<8x8 x f16> -> !warp.tile<8x8 x f16>
  %t = warp.tile_map(%h, %q) {
  ^bb0(%u: f16, %v: f16):
    %w = warp.add(%u, %v) : (f16, f16) -> f16
    warp.tile_yield %w : f16
  } : (!warp.tile<8x8 x f16>, !warp.tile<8x8 x f16>) -> !warp.tile<8x8 x f16>
  warp.tile_store %t, %b[%c0, %c0] : !warp.tile<8x8 x f16>, !warp.array<2 x f16>, (si32, si32)
  return
}

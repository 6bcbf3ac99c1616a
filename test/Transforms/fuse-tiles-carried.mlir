// RUN: warp-opt %s --split-input-file --warp-fuse-tiles | FileCheck %s

// A tile that a loop changes through a view, and gives through one, is carried
// in the shape of the view; so a product is added to it without a copy.
// CHECK-LABEL: func.func @reshaped
// CHECK: %[[INIT:.*]] = warp.tile_reshape %{{.*}} -> !warp.tile<8x8 x f32>
// CHECK: %[[R:.*]]:2 = scf.while (%{{[^,]*}}, %{{[^=]*}} = %[[INIT]])
// CHECK: ^bb0(%{{[^,]*}}, %[[S:[^:]*]]: !warp.tile<8x8 x f32>):
// CHECK: %[[IF:.*]] = scf.if %{{.*}} -> (!warp.tile<8x8 x f32>)
// CHECK-NEXT: scf.yield %[[S]]
// CHECK: %[[N:.*]] = warp.tile_matmul %{{.*}} add %[[S]]
// CHECK-NEXT: scf.yield %[[N]]
// CHECK: scf.yield %{{.*}}, %[[IF]]
// CHECK-NOT: warp.tile_reshape
// CHECK: warp.tile_store %[[R]]#1
func.func @reshaped(%a: !warp.array<2 x f32>, %m: !warp.array<1 x f32>, %n: si32)
    attributes {warp.kernel, warp.block_threads = 32 : i64} {
  %c0 = warp.constant 0 : si32
  %c1 = warp.constant 1 : si32
  %flat = warp.tile_load %m[%c0] : !warp.array<1 x f32>, (si32) -> !warp.tile<64 x f32>
  %r:2 = scf.while (%k = %c0, %s = %flat)
      : (si32, !warp.tile<64 x f32>) -> (si32, !warp.tile<64 x f32>) {
    %less = warp.lt(%k, %n) : (si32, si32) -> i1
    scf.condition(%less) %k, %s : si32, !warp.tile<64 x f32>
  } do {
  ^bb0(%k: si32, %s: !warp.tile<64 x f32>):
    %skips = warp.eq(%k, %c1) : (si32, si32) -> i1
    %next = scf.if %skips -> (!warp.tile<64 x f32>) {
      scf.yield %s : !warp.tile<64 x f32>
    } else {
      %x = warp.tile_load %a[%k, %c0] : !warp.array<2 x f32>, (si32, si32)
        -> !warp.tile<8x8 x f32>
      %p = warp.tile_matmul %x, %x : !warp.tile<8x8 x f32>, !warp.tile<8x8 x f32>
        -> !warp.tile<8x8 x f32>
      %v = warp.tile_reshape %s : !warp.tile<64 x f32> -> !warp.tile<8x8 x f32>
      %t = warp.tile_map(%v, %p) {
      ^bb0(%e: f32, %f: f32):
        %g = warp.add(%e, %f) : (f32, f32) -> f32
        warp.tile_yield %g : f32
      } : (!warp.tile<8x8 x f32>, !warp.tile<8x8 x f32>) -> !warp.tile<8x8 x f32>
      %w = warp.tile_reshape %t : !warp.tile<8x8 x f32> -> !warp.tile<64 x f32>
      scf.yield %w : !warp.tile<64 x f32>
    }
    %k1 = warp.add(%k, %c1) : (si32, si32) -> si32
    scf.yield %k1, %next : si32, !warp.tile<64 x f32>
  }
  %back = warp.tile_reshape %r#1 : !warp.tile<64 x f32> -> !warp.tile<8x8 x f32>
  warp.tile_store %back, %a[%c0, %c0] : !warp.tile<8x8 x f32>, !warp.array<2 x f32>, (si32, si32)
  return
}

// -----

// One that is also used as it is keeps its shape.
// CHECK-LABEL: func.func @both
// CHECK: scf.for {{.*}} -> (!warp.tile<64 x f32>)
func.func @both(%a: !warp.array<2 x f32>, %m: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64} {
  %c0 = warp.constant 0 : si32
  %lo = arith.constant 0 : i32
  %hi = arith.constant 4 : i32
  %one = arith.constant 1 : i32
  %flat = warp.tile_load %m[%c0] : !warp.array<1 x f32>, (si32) -> !warp.tile<64 x f32>
  %r = scf.for %i = %lo to %hi step %one iter_args(%s = %flat)
      -> (!warp.tile<64 x f32>) : i32 {
    %v = warp.tile_reshape %s : !warp.tile<64 x f32> -> !warp.tile<8x8 x f32>
    %t = warp.tile_matmul %v, %v : !warp.tile<8x8 x f32>, !warp.tile<8x8 x f32>
      -> !warp.tile<8x8 x f32>
    %w = warp.tile_reshape %t : !warp.tile<8x8 x f32> -> !warp.tile<64 x f32>
    scf.yield %w : !warp.tile<64 x f32>
  }
  warp.tile_store %r, %m[%c0] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32)
  return
}

// RUN: warp-opt %s --split-input-file --warp-form-lane-loops | FileCheck %s

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, rank = 2>

// A value that a thread loads is kept for the operation on tiles; the sum is
// uniform, and threads store in a loop of their own.
// CHECK-LABEL: func.func @center
// CHECK-SAME: warp.block_threads = 1
// CHECK: %[[TID:.*]]:2 = warp.tid
// CHECK: warp.mod(%[[TID]]#1, %{{.*}})
// CHECK: scf.if
// CHECK: %[[X:.*]] = scf.for %{{.*}} iter_args(%[[T:.*]] = %{{.*}}) -> (!warp.tile<64 x f32>)
// CHECK: %[[V:.*]] = warp.load
// CHECK: %[[U:.*]] = warp.tile_set assign %[[V]], %[[T]]
// CHECK: scf.yield %[[U]]
// CHECK: %[[S:.*]] = warp.tile_reduce add %[[X]]
// CHECK: %[[MEAN:.*]] = warp.tile_get %[[S]]
// CHECK: scf.for
// CHECK: %[[MINE:.*]] = warp.tile_get %[[X]]
// CHECK: %[[D:.*]] = warp.sub(%[[MINE]], %[[MEAN]])
// CHECK: warp.store %[[D]]
module {
  func.func @center(%a: !warp.array<1 x f32>) attributes
      {warp.kernel, warp.block_threads = 64 : i64, warp.variant = #cpu} {
    %zero = warp.constant 0 : si32
    %i, %lane = warp.tid : si32, si32
    %x = warp.load %a[%lane] : !warp.array<1 x f32>, si32 -> f32
    %t = warp.tile_from_threads %x : f32 -> !warp.tile<64 x f32>
    %s = warp.tile_reduce add %t : !warp.tile<64 x f32> -> !warp.tile<1 x f32>
    %mean = warp.tile_get %s[%zero] : !warp.tile<1 x f32>, (si32) -> f32
    %d = warp.sub(%x, %mean) : (f32, f32) -> f32
    warp.store %d, %a[%lane] : f32, !warp.array<1 x f32>, si32
    return
  }
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, rank = 2>

// A GPU has the threads.
// CHECK-LABEL: func.func @alone
// CHECK-SAME: warp.block_threads = 64
// CHECK-NOT: scf.for
module {
  func.func @alone(%a: !warp.array<1 x f32>) attributes
      {warp.kernel, warp.block_threads = 64 : i64, warp.variant = #gpu} {
    %i, %lane = warp.tid : si32, si32
    %x = warp.load %a[%lane] : !warp.array<1 x f32>, si32 -> f32
    %t = warp.tile_from_threads %x : f32 -> !warp.tile<64 x f32>
    %y = warp.tile_to_threads %t : !warp.tile<64 x f32> -> f32
    warp.store %y, %a[%lane] : f32, !warp.array<1 x f32>, si32
    return
  }
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>>

// A value from outside that a function of elements uses and that differs
// between threads of becomes an operand.
// CHECK-LABEL: func.func @captured
// CHECK: %[[OWN:.*]] = scf.for {{.*}} -> (!warp.tile<4 x si32>)
// CHECK: warp.tile_map(%{{.*}}, %{{.*}}) {
// CHECK-NEXT: ^bb0(%[[A:.*]]: f32, %[[I:.*]]: si32):
// CHECK-NEXT: warp.load %{{.*}}[%[[I]]]
func.func @captured(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 4 : i64, warp.variant = #cpu} {
  %c0 = warp.constant 0 : si32
  %c2 = warp.constant 2 : si32
  %i = warp.tid : si32
  %first = warp.mul(%i, %c2) : (si32, si32) -> si32
  %t = warp.tile_load %x[%c0] : !warp.array<1 x f32>, (si32) -> !warp.tile<4 x f32>
  %u = warp.tile_map(%t) {
  ^bb0(%a: f32):
    %v = warp.load %y[%first] : !warp.array<1 x f32>, si32 -> f32
    %w = warp.add(%a, %v) : (f32, f32) -> f32
    warp.tile_yield %w : f32
  } : (!warp.tile<4 x f32>) -> !warp.tile<4 x f32>
  warp.tile_store %u, %x[%c0] : !warp.tile<4 x f32>, !warp.array<1 x f32>, (si32)
  return
}

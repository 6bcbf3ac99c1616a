// RUN: warp-opt %s --split-input-file --warp-form-launch --warp-widen-threads \
// RUN:   | FileCheck %s

#cpu = #warp.variant<target = <platform = cpu, bits = 256>, contiguous = 3,
                     lanes = 8>

// Threads leave the loop at different times: a lane that is done takes another
// thread. What is before the loop runs for lanes that begin one, the loop until
// half of the lanes wait for a next one, what is after it for those that left.
// The counter differs from lane to lane, and elements are gathered.
// CHECK-LABEL: func.func @trips
// CHECK: warp.threads attributes {{.*}}lanes = 8 : i64, {{.*}}turns = 128 : i64
// CHECK: ^bb0(%[[FIRST:.*]]: i32, %[[LIVE:.*]]: vector<8xi1>, %[[COUNT:.*]]: i32):
// CHECK: %[[LIMIT:.*]] = warp.broadcast %[[COUNT]]
// CHECK: scf.while
// CHECK: warp.any
// CHECK: scf.if
// CHECK: warp.load_lanes gather %arg0
// CHECK: scf.while
// CHECK: warp.any %{{.*}} {least = 4 : i64}
// CHECK: arith.mulf %{{.*}} : vector<8xf32>
// CHECK: arith.addi %{{.*}} : vector<8xi32>
// CHECK: warp.store_lanes gather(%{{.*}}), %arg1
func.func @trips(%x: !warp.array<1 x f32>, %y: !warp.array<1 x si32>, %n: i32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %half = arith.constant 0.5 : f32
  %least = arith.constant 0.01 : f32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %end:2 = scf.while (%z = %v, %k = %c0) : (f32, i32) -> (f32, i32) {
    %far = arith.cmpf ogt, %z, %least : f32
    %more = arith.cmpi slt, %k, %n : i32
    %go = arith.andi %far, %more : i1
    scf.condition(%go) %z, %k : f32, i32
  } do {
  ^bb0(%z: f32, %k: i32):
    %a = arith.mulf %z, %half : f32
    %b = arith.addf %a, %z : f32
    %c = arith.mulf %b, %half : f32
    %d = arith.subf %c, %least : f32
    %next = arith.addi %k, %c1 : i32
    scf.yield %d, %next : f32, i32
  }
  warp.store_components(%end#1), %y[%i] : (i32), !warp.array<1 x si32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <platform = cpu, bits = 256>, contiguous = 3,
                     lanes = 8>

// A loop that stores is not entered again.
// CHECK-LABEL: func.func @stores
// CHECK-NOT: turns
// CHECK: return
func.func @stores(%x: !warp.array<1 x f32>, %y: !warp.array<1 x si32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %half = arith.constant 0.5 : f32
  %least = arith.constant 0.01 : f32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %end:2 = scf.while (%z = %v, %k = %c0) : (f32, i32) -> (f32, i32) {
    %far = arith.cmpf ogt, %z, %least : f32
    scf.condition(%far) %z, %k : f32, i32
  } do {
  ^bb0(%z: f32, %k: i32):
    %a = arith.mulf %z, %half : f32
    %b = arith.addf %a, %z : f32
    %c = arith.mulf %b, %half : f32
    %d = arith.subf %c, %least : f32
    %next = arith.addi %k, %c1 : i32
    warp.store_components(%next), %y[%i] : (i32), !warp.array<1 x si32>, i32
    scf.yield %d, %next : f32, i32
  }
  return
}

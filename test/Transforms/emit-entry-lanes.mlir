// RUN: warp-opt %s --split-input-file --warp-emit-entry | FileCheck %s

#cpu = #warp.variant<target = <name = "cpu", bits = 256>>

// A range is a loop over full vectors, whose mask is a constant, and one vector
// more for the threads that are left, if there are any. A range that ends before
// it begins has none.
// CHECK-LABEL: llvm.func @line
// CHECK-SAME: %[[BEGIN:[^ ]+]]: i64, %[[GIVEN:[^ ]+]]: i64)
// CHECK: %[[END:.*]] = arith.maxsi %[[BEGIN]], %[[GIVEN]]
// CHECK: %[[COUNT:.*]] = arith.subi %[[END]], %[[BEGIN]]
// CHECK: %[[MULTIPLE:.*]] = arith.constant -4 : i64
// CHECK: %[[WHOLE:.*]] = arith.andi %[[COUNT]], %[[MULTIPLE]]
// CHECK: %[[LAST:.*]] = arith.addi %[[BEGIN]], %[[WHOLE]]
// CHECK: %[[WIDTH:.*]] = arith.constant 4 : i64
// CHECK: scf.for %[[N:[^ ]+]] = %[[BEGIN]] to %[[LAST]] step %[[WIDTH]]
// CHECK: %[[ALL:.*]] = arith.constant dense<true> : vector<4xi1>
// CHECK: %[[I:.*]] = arith.trunci %[[N]]
// CHECK: %[[LANES:.*]] = warp.broadcast %[[I]]
// CHECK: warp.each_lane %[[ALL]](%[[LANES]])
// CHECK: %[[ANY:.*]] = arith.cmpi slt, %[[LAST]], %[[END]]
// CHECK: scf.if %[[ANY]] {
// CHECK: %[[LEFT:.*]] = arith.subi %[[END]], %[[LAST]]
// CHECK: %[[NUMBERS:.*]] = warp.lane_numbers
// CHECK: %[[LIMIT:.*]] = warp.broadcast
// CHECK: %[[SOME:.*]] = arith.cmpi slt, %[[NUMBERS]], %[[LIMIT]]
// CHECK: warp.each_lane %[[SOME]](
func.func @line(%x: !warp.array<1 x si32>, %n: i32)
    attributes {warp.kernel, warp.variant = #cpu} {
  warp.group {
    warp.threads attributes {kinds = array<i32>, lanes = 4 : i64, types = []} {
    ^bb0(%i: i32, %live: vector<4xi1>):
      %lanes = warp.broadcast %i : i32 -> vector<4xi32>
      %r = warp.each_lane %live (%lanes) {
      ^bb0(%j: i32):
        warp.store_components(%j), %x[%n] : (i32), !warp.array<1 x si32>, i32
        warp.yield %j : i32
      } : vector<4xi1>, vector<4xi32> -> vector<4xi32>
      warp.yield
    }
  }
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, rank = 2>

// Rows of a plane are such ranges; sums go through all of them as vectors, and
// their lanes are combined at the end, before they are published.
// CHECK-LABEL: llvm.func @plane
// CHECK: %[[NONE:.*]] = arith.constant -0.000000e+00 : f32
// CHECK: %[[START:.*]] = warp.broadcast %[[NONE]]
// CHECK: %[[ALL:.*]] = scf.if %{{.*}} -> (vector<4xf32>) {
// CHECK: %[[ROWS:.*]] = scf.for {{.*}} iter_args(%[[SUM:.*]] = %[[START]]) -> (vector<4xf32>)
// CHECK: %[[FULL:.*]] = scf.for {{.*}} iter_args(%[[S:.*]] = %[[SUM]]) -> (vector<4xf32>)
// CHECK: %[[NEXT:.*]] = arith.addf %[[S]], %{{.*}} fastmath<reassoc> : vector<4xf32>
// CHECK: scf.yield %[[NEXT]]
// CHECK: %[[REST:.*]] = scf.if %{{.*}} -> (vector<4xf32>) {
// CHECK: arith.addf %[[FULL]], %{{.*}} fastmath<reassoc> : vector<4xf32>
// CHECK: } else {
// CHECK: scf.yield %[[FULL]]
// CHECK: scf.yield %[[REST]]
// CHECK: } else {
// CHECK: scf.yield %[[START]]
// CHECK: %[[TOTAL:.*]] = warp.combine_lanes %[[ALL]] {kind = 0 : i32, type = f32}
// CHECK: warp.atomic_components add(%[[TOTAL]])
func.func @plane(%x: !warp.array<1 x f32>, %a: f32)
    attributes {warp.kernel, warp.variant = #cpu} {
  warp.group {
    %sum = warp.threads attributes {
        kinds = array<i32: 0>, lanes = 4 : i64, types = [f32]} {
    ^bb0(%j: i32, %i: i32, %live: vector<4xi1>):
      %v = warp.broadcast %a : f32 -> vector<4xf32>
      warp.yield %v : vector<4xf32>
    } : f32
    warp.once {
      %c0 = arith.constant 0 : i32
      %old = warp.atomic_components add(%sum), %x[%c0]
        : (f32), !warp.array<1 x f32>, i32 -> f32
    }
  }
  return
}

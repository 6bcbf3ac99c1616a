// RUN: warp-opt %s --split-input-file --warp-form-launch \
// RUN:     --warp-widen-threads | FileCheck %s

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 14,
      disjoint = true, lanes = 4>

// A loop through runs of a list, whose condition looks for the next run when one
// has ended, in threads that follow the order of a hash grid. Lanes come to an element together: what is there is loaded once, as
// a scalar, and those whose place it is take part. Only where none is at the
// expected place is the least one looked for.
// CHECK-LABEL: func.func @neighbours
// CHECK: scf.while
// CHECK: scf.while
// CHECK: scf.while
// CHECK: arith.cmpi slt, %[[PLACES:.*]], %{{.*}} : vector<4xi32>
// CHECK: warp.any
// CHECK: ^bb0(%[[MASK:[^:]+]]: vector<4xi1>, {{.*}}%[[PLACE:[^:, ]+]]: vector<4xi32>, %[[S:[^:, ]+]]: vector<4xf32>, %[[HINT:[^:, ]+]]: i32)
// CHECK: %[[ALL:.*]] = warp.broadcast %[[HINT]]
// CHECK: %[[AT:.*]] = arith.cmpi eq, %[[PLACE]], %[[ALL]]
// CHECK: %[[LIVE:.*]] = arith.andi %[[MASK]], %[[AT]]
// CHECK: %[[SOME:.*]] = warp.any %[[LIVE]]
// CHECK: %[[U:.*]] = scf.if %[[SOME]] -> (i32)
// CHECK: scf.yield %[[HINT]]
// CHECK: else
// CHECK: warp.combine_lanes
// CHECK: %[[HERE:.*]] = arith.cmpi eq, %[[PLACE]], %{{.*}}
// CHECK: arith.andi %[[MASK]], %[[HERE]]
// CHECK: %[[J:.*]] = warp.load_components %{{.*}}[%[[U]]] : !warp.array<1 x si32>, i32 -> i32
// CHECK: warp.load_components %arg2[%[[J]]] : !warp.array<1 x f32>, i32 -> f32
// CHECK: arith.addi %[[U]], %{{.*}} : i32
func.func @neighbours(%grid: i64, %starts: !warp.array<1 x si32>,
                      %x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %zero = arith.constant 0.0 : f32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %c3 = arith.constant 3 : i32
  %c11 = arith.constant 11 : i32
  %c32 = arith.constant 32 : i32
  %false = arith.constant false
  %slot = warp.library_call "warp_slot"(%grid, %c1) : (i64, i32) -> i64
  %words = warp.array_at %slot[%c32] : i64, i32 -> !warp.array<1 x ui64>
  %at = warp.load_components %words[%c11] : !warp.array<1 x ui64>, i32 -> i64
  %list = warp.array_at %at[%c32] : i64, i32 -> !warp.array<1 x si32>
  %self = warp.load_components %list[%i] : !warp.array<1 x si32>, i32 -> i32
  %r:4 = scf.while (%row = %c0, %p = %c0, %e = %c0, %s = %zero)
      : (i32, i32, i32, f32) -> (i32, i32, i32, f32) {
    %q:3 = scf.while (%row1 = %row, %p1 = %p, %e1 = %e)
        : (i32, i32, i32) -> (i32, i32, i32) {
      %ended = arith.cmpi sge, %p1, %e1 : i32
      %more = scf.if %ended -> (i1) {
        %left = arith.cmpi slt, %row1, %c3 : i32
        scf.yield %left : i1
      } else {
        scf.yield %false : i1
      }
      scf.condition(%more) %row1, %p1, %e1 : i32, i32, i32
    } do {
    ^bb0(%row1: i32, %p1: i32, %e1: i32):
      %cell = arith.addi %row1, %i : i32
      %behind = arith.addi %cell, %c1 : i32
      %begin = warp.load_components %starts[%cell] : !warp.array<1 x si32>, i32 -> i32
      %end = warp.load_components %starts[%behind] : !warp.array<1 x si32>, i32 -> i32
      %next = arith.addi %row1, %c1 : i32
      scf.yield %next, %begin, %end : i32, i32, i32
    }
    %in = arith.cmpi slt, %q#1, %q#2 : i32
    scf.condition(%in) %q#0, %q#1, %q#2, %s : i32, i32, i32, f32
  } do {
  ^bb0(%row: i32, %p: i32, %e: i32, %s: f32):
    %j = warp.load_components %list[%p] : !warp.array<1 x si32>, i32 -> i32
    %p2 = arith.addi %p, %c1 : i32
    %v = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
    %t = arith.addf %s, %v : f32
    scf.yield %row, %p2, %e, %t : i32, i32, i32, f32
  }
  warp.store_components(%r#3), %y[%self] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 14,
      disjoint = true, lanes = 4>

// Threads that do not follow a grid have nothing in common: each lane loads at
// its own place.
// CHECK-LABEL: func.func @no_order
// CHECK-NOT: warp.combine_lanes
// CHECK: warp.load_lanes gather %arg2
func.func @no_order(%grid: i64, %starts: !warp.array<1 x si32>,
                      %x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %zero = arith.constant 0.0 : f32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %c3 = arith.constant 3 : i32
  %c11 = arith.constant 11 : i32
  %c32 = arith.constant 32 : i32
  %false = arith.constant false
  %slot = warp.library_call "warp_slot"(%grid, %c1) : (i64, i32) -> i64
  %words = warp.array_at %slot[%c32] : i64, i32 -> !warp.array<1 x ui64>
  %at = warp.load_components %words[%c11] : !warp.array<1 x ui64>, i32 -> i64
  %list = warp.array_at %at[%c32] : i64, i32 -> !warp.array<1 x si32>
  %r:4 = scf.while (%row = %c0, %p = %c0, %e = %c0, %s = %zero)
      : (i32, i32, i32, f32) -> (i32, i32, i32, f32) {
    %q:3 = scf.while (%row1 = %row, %p1 = %p, %e1 = %e)
        : (i32, i32, i32) -> (i32, i32, i32) {
      %ended = arith.cmpi sge, %p1, %e1 : i32
      %more = scf.if %ended -> (i1) {
        %left = arith.cmpi slt, %row1, %c3 : i32
        scf.yield %left : i1
      } else {
        scf.yield %false : i1
      }
      scf.condition(%more) %row1, %p1, %e1 : i32, i32, i32
    } do {
    ^bb0(%row1: i32, %p1: i32, %e1: i32):
      %cell = arith.addi %row1, %i : i32
      %behind = arith.addi %cell, %c1 : i32
      %begin = warp.load_components %starts[%cell] : !warp.array<1 x si32>, i32 -> i32
      %end = warp.load_components %starts[%behind] : !warp.array<1 x si32>, i32 -> i32
      %next = arith.addi %row1, %c1 : i32
      scf.yield %next, %begin, %end : i32, i32, i32
    }
    %in = arith.cmpi slt, %q#1, %q#2 : i32
    scf.condition(%in) %q#0, %q#1, %q#2, %s : i32, i32, i32, f32
  } do {
  ^bb0(%row: i32, %p: i32, %e: i32, %s: f32):
    %j = warp.load_components %list[%p] : !warp.array<1 x si32>, i32 -> i32
    %p2 = arith.addi %p, %c1 : i32
    %v = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
    %t = arith.addf %s, %v : f32
    scf.yield %row, %p2, %e, %t : i32, i32, i32, f32
  }
  warp.store_components(%r#3), %y[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 30,
      disjoint = true, lanes = 4>

// Terms that lanes together add to an element are added once.
// CHECK-LABEL: func.func @scattered
// CHECK: %[[J:.*]] = warp.load_components %{{.*}} : !warp.array<1 x si32>, i32 -> i32
// CHECK: warp.load_components %arg2[%[[J]]] : !warp.array<1 x f32>, i32 -> f32
// CHECK: %[[SUM:.*]] = warp.combine_lanes
// CHECK: warp.atomic_components add(%[[SUM]]), %arg4[%[[J]]]
// CHECK-NOT: warp.update_lanes
// CHECK: return
func.func @scattered(%grid: i64, %starts: !warp.array<1 x si32>,
                      %x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>,
                     %g: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %zero = arith.constant 0.0 : f32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %c3 = arith.constant 3 : i32
  %c11 = arith.constant 11 : i32
  %c32 = arith.constant 32 : i32
  %false = arith.constant false
  %slot = warp.library_call "warp_slot"(%grid, %c1) : (i64, i32) -> i64
  %words = warp.array_at %slot[%c32] : i64, i32 -> !warp.array<1 x ui64>
  %at = warp.load_components %words[%c11] : !warp.array<1 x ui64>, i32 -> i64
  %list = warp.array_at %at[%c32] : i64, i32 -> !warp.array<1 x si32>
  %self = warp.load_components %list[%i] : !warp.array<1 x si32>, i32 -> i32
  %r:4 = scf.while (%row = %c0, %p = %c0, %e = %c0, %s = %zero)
      : (i32, i32, i32, f32) -> (i32, i32, i32, f32) {
    %q:3 = scf.while (%row1 = %row, %p1 = %p, %e1 = %e)
        : (i32, i32, i32) -> (i32, i32, i32) {
      %ended = arith.cmpi sge, %p1, %e1 : i32
      %more = scf.if %ended -> (i1) {
        %left = arith.cmpi slt, %row1, %c3 : i32
        scf.yield %left : i1
      } else {
        scf.yield %false : i1
      }
      scf.condition(%more) %row1, %p1, %e1 : i32, i32, i32
    } do {
    ^bb0(%row1: i32, %p1: i32, %e1: i32):
      %cell = arith.addi %row1, %i : i32
      %behind = arith.addi %cell, %c1 : i32
      %begin = warp.load_components %starts[%cell] : !warp.array<1 x si32>, i32 -> i32
      %end = warp.load_components %starts[%behind] : !warp.array<1 x si32>, i32 -> i32
      %next = arith.addi %row1, %c1 : i32
      scf.yield %next, %begin, %end : i32, i32, i32
    }
    %in = arith.cmpi slt, %q#1, %q#2 : i32
    scf.condition(%in) %q#0, %q#1, %q#2, %s : i32, i32, i32, f32
  } do {
  ^bb0(%row: i32, %p: i32, %e: i32, %s: f32):
    %j = warp.load_components %list[%p] : !warp.array<1 x si32>, i32 -> i32
    %p2 = arith.addi %p, %c1 : i32
    %v = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
    %old = warp.atomic_components add(%v), %g[%j] : (f32), !warp.array<1 x f32>, i32 -> f32
    %t = arith.addf %s, %v : f32
    scf.yield %row, %p2, %e, %t : i32, i32, i32, f32
  }
  warp.store_components(%r#3), %y[%self] : (f32), !warp.array<1 x f32>, i32
  return
}

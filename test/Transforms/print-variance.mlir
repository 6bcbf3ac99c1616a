// RUN: warp-opt %s --split-input-file --warp-print-variance -o /dev/null \
// RUN:   | FileCheck %s

// The sum of an index and itself has step 2, whatever its form.
// CHECK-LABEL: variance of @twice
// CHECK: %0 = warp.tid: step 1
// CHECK-NEXT: %1 = arith.addi: step 2
func.func @twice() attributes {warp.kernel} {
  %i = warp.tid : i32
  %twice = arith.addi %i, %i : i32
  return
}

// -----

// Sums, differences and products with constants are linear; a step that is too
// large or a product of indices is not.
// CHECK-LABEL: variance of @linear
// CHECK-COUNT-3: arith.constant: uniform over the launch
// CHECK: = warp.tid: step 1
// CHECK-NEXT: = arith.addi: step 1
// CHECK-NEXT: = arith.addi: step 1
// CHECK-NEXT: = arith.subi: step -1
// CHECK-NEXT: = arith.subi: step 0
// CHECK-NEXT: = arith.muli: step 3
// CHECK-NEXT: = arith.muli: step 3
// CHECK-NEXT: = arith.shli: step 8
// CHECK-NEXT: = arith.muli: varies
// CHECK-NEXT: = arith.muli: varies
// CHECK-NEXT: = arith.shli: varies
func.func @linear(%n: i32) attributes {warp.kernel} {
  %c1 = arith.constant 1 : i32
  %c3 = arith.constant 3 : i32
  %c40 = arith.constant 40 : i32
  %i = warp.tid : i32
  %a = arith.addi %i, %c1 : i32
  %b = arith.addi %n, %i : i32
  %c = arith.subi %n, %i : i32
  %d = arith.subi %i, %i : i32
  %e = arith.muli %i, %c3 : i32
  %f = arith.muli %c3, %i : i32
  %g = arith.shli %i, %c3 : i32
  %h = arith.muli %i, %n : i32
  %j = arith.muli %i, %i : i32
  %k = arith.shli %i, %c40 : i32
  return
}

// -----

// Wider integers keep the step; a truncation to fewer bits than an index has,
// and a boolean, do not.
// CHECK-LABEL: variance of @casts
// CHECK: = warp.tid: step 1
// CHECK-NEXT: = arith.extsi: step 1
// CHECK-NEXT: = arith.extui: step 1
// CHECK-NEXT: = arith.index_cast: step 1
// CHECK-NEXT: = arith.trunci: step 1
// CHECK-NEXT: = arith.trunci: varies
// CHECK-NEXT: = arith.extsi: varies
// CHECK-NEXT: = arith.trunci: varies
// CHECK-NEXT: = arith.extui: varies
// CHECK-NEXT: = arith.sitofp: varies
func.func @casts() attributes {warp.kernel} {
  %i = warp.tid : i32
  %a = arith.extsi %i : i32 to i64
  %b = arith.extui %i : i32 to i64
  %c = arith.index_cast %i : i32 to index
  %d = arith.trunci %a : i64 to i32
  %e = arith.trunci %i : i32 to i8
  %f = arith.extsi %e : i8 to i32
  %g = arith.trunci %i : i32 to i1
  %h = arith.extui %g : i1 to i32
  %j = arith.sitofp %i : i32 to f32
  return
}

// -----

// Divisions and bits of an index are not linear; the same of what threads share
// is shared.
// CHECK-LABEL: variance of @others
// CHECK: = arith.constant: uniform over the launch
// CHECK: = warp.tid: step 1
// CHECK-NEXT: = arith.divui: varies
// CHECK-NEXT: = arith.remui: varies
// CHECK-NEXT: = arith.andi: varies
// CHECK-NEXT: = arith.shrui: varies
// CHECK-NEXT: = arith.minsi: varies
// CHECK-NEXT: = arith.cmpi: varies
// CHECK-NEXT: = arith.divui: uniform over the launch
// CHECK-NEXT: = arith.cmpi: uniform over the launch
func.func @others(%n: i32) attributes {warp.kernel} {
  %c4 = arith.constant 4 : i32
  %i = warp.tid : i32
  %a = arith.divui %i, %c4 : i32
  %b = arith.remui %i, %c4 : i32
  %c = arith.andi %i, %c4 : i32
  %d = arith.shrui %i, %c4 : i32
  %e = arith.minsi %i, %n : i32
  %f = arith.cmpi slt, %i, %n : i32
  %g = arith.divui %n, %c4 : i32
  %h = arith.cmpi slt, %n, %c4 : i32
  return
}

// -----

// A shared choice of two values with one step keeps it.
// CHECK-LABEL: variance of @choices
// CHECK: = warp.tid: step 1
// CHECK: = arith.addi: step 1
// CHECK-NEXT: = arith.addi: step 2
// CHECK-NEXT: = arith.cmpi: varies
// CHECK-NEXT: = arith.select: step 1
// CHECK-NEXT: = arith.select: varies
// CHECK-NEXT: = arith.select: varies
// CHECK-NEXT: = arith.select: uniform over the launch
// CHECK-NEXT: = arith.select: varies
func.func @choices(%b: i1, %n: i32, %m: i32) attributes {warp.kernel} {
  %i = warp.tid : i32
  %c1 = arith.constant 1 : i32
  %j = arith.addi %i, %c1 : i32
  %k = arith.addi %i, %i : i32
  %own = arith.cmpi slt, %i, %n : i32
  %a = arith.select %b, %i, %j : i32
  %c = arith.select %b, %i, %k : i32
  %d = arith.select %own, %i, %j : i32
  %e = arith.select %b, %n, %m : i32
  %f = arith.select %own, %n, %m : i32
  return
}

// -----

// The last of several indices tells lanes apart; the others are the same
// for lanes, not for the launch.
// CHECK-LABEL: variance of @plane
// CHECK: %0#0 = warp.tid: uniform over lanes
// CHECK-NEXT: %0#1 = warp.tid: step 1
// CHECK: = arith.muli: uniform over lanes
// CHECK-NEXT: = arith.addi: step 1
func.func @plane(%n: i32) attributes {warp.kernel} {
  %j, %i = warp.tid : i32, i32
  %row = arith.muli %j, %n : i32
  %at = arith.addi %row, %i : i32
  return
}

// -----

// In launch IR the indices are those of the region.
// CHECK-LABEL: variance of @launch
// CHECK: %[[SUM:.*]] = warp.threads: uniform over the launch
// CHECK-NEXT: %{{.*}}: uniform over lanes
// CHECK-NEXT: %{{.*}}: step 1
// CHECK: = arith.addi: step 1
func.func @launch() attributes {warp.kernel} {
  warp.group {
    %sum = warp.threads attributes {kinds = array<i32: 0>, types = [i32]} {
    ^bb0(%j: i32, %i: i32):
      %k = arith.addi %i, %j : i32
      warp.yield %k : i32
    } : i32
  }
  return
}

// RUN: warp-opt %s --split-input-file --warp-form-launch \
// RUN:     --warp-widen-threads | FileCheck %s

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 1, non_negative = 2,
      disjoint = true, lanes = 1>

// The loop carries the element that the next iteration loads; the first one's
// is loaded before, if there is an iteration.
// CHECK-LABEL: func.func @recurrence
// CHECK: %[[RUNS:.*]] = arith.cmpi slt, %[[LOW:.*]], %arg1
// CHECK: %[[FIRST:.*]] = scf.if %[[RUNS]] -> (f32) {
// CHECK: %[[LOADED:.*]] = warp.load_components %arg0[%{{.*}}, %[[LOW]]]
// CHECK: scf.yield %[[LOADED]]
// CHECK: scf.for {{.*}} iter_args(%[[C:.*]] = %[[FIRST]])
// CHECK-NOT: warp.load_components
// CHECK: %[[NEW:.*]] = math.exp %[[C]]
// CHECK: warp.store_components(%[[NEW]])
// CHECK: scf.yield %[[NEW]]
func.func @recurrence(%y: !warp.array<2 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  scf.for %k = %c0 to %n step %c1 : i32 {
    %v = warp.load_components %y[%i, %k] : !warp.array<2 x f32>, i32, i32 -> f32
    %e = math.exp %v : f32
    %next = arith.addi %k, %c1 : i32
    warp.store_components(%e), %y[%i, %next] : (f32), !warp.array<2 x f32>, i32, i32
  }
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 1, non_negative = 2,
      disjoint = true, lanes = 1>

// A loop of a known number of iterations has no branch before it; one that goes
// back carries, too, and what is read again behind the store is its value.
// CHECK-LABEL: func.func @backwards
// CHECK-NOT: scf.if
// CHECK: %[[FIRST:.*]] = warp.load_components %arg0
// CHECK: scf.for {{.*}} iter_args(%[[C:.*]] = %[[FIRST]])
// CHECK-NOT: warp.load_components
// CHECK: %[[NEW:.*]] = math.exp %[[C]]
// CHECK: warp.store_components(%[[NEW]]), %arg0
// CHECK-NOT: warp.load_components
// CHECK: arith.addf %[[NEW]], %[[NEW]]
// CHECK: scf.yield %[[NEW]]
func.func @backwards(%y: !warp.array<2 x f32>, %z: !warp.array<2 x f32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %c9 = arith.constant 9 : i32
  scf.for %k = %c0 to %c9 step %c1 : i32 {
    %at = arith.subi %c9, %k : i32
    %v = warp.load_components %y[%i, %at] : !warp.array<2 x f32>, i32, i32 -> f32
    %e = math.exp %v : f32
    %next = arith.subi %at, %c1 : i32
    warp.store_components(%e), %y[%i, %next] : (f32), !warp.array<2 x f32>, i32, i32
    %again = warp.load_components %y[%i, %next] : !warp.array<2 x f32>, i32, i32 -> f32
    %twice = arith.addf %again, %e : f32
    warp.store_components(%twice), %z[%i, %k] : (f32), !warp.array<2 x f32>, i32, i32
  }
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 1, non_negative = 2,
      disjoint = true, lanes = 1>

// Nothing is carried where an element is read two iterations later, where
// another store or a branch writes to the array, or where the row changes.
// CHECK-LABEL: func.func @not
// CHECK-NOT: iter_args
// CHECK: return
func.func @not(%y: !warp.array<2 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %c2 = arith.constant 2 : i32
  scf.for %k = %c0 to %n step %c1 : i32 {
    %v = warp.load_components %y[%i, %k] : !warp.array<2 x f32>, i32, i32 -> f32
    %next = arith.addi %k, %c2 : i32
    warp.store_components(%v), %y[%i, %next] : (f32), !warp.array<2 x f32>, i32, i32
  }
  scf.for %k = %c0 to %n step %c1 : i32 {
    %v = warp.load_components %y[%i, %k] : !warp.array<2 x f32>, i32, i32 -> f32
    %next = arith.addi %k, %c1 : i32
    warp.store_components(%v), %y[%i, %next] : (f32), !warp.array<2 x f32>, i32, i32
    warp.store_components(%v), %y[%next, %i] : (f32), !warp.array<2 x f32>, i32, i32
  }
  scf.for %k = %c0 to %n step %c1 : i32 {
    %v = warp.load_components %y[%i, %k] : !warp.array<2 x f32>, i32, i32 -> f32
    %next = arith.addi %k, %c1 : i32
    %is = arith.cmpi slt, %next, %i : i32
    scf.if %is {
      warp.store_components(%v), %y[%i, %next] : (f32), !warp.array<2 x f32>, i32, i32
    }
  }
  scf.for %k = %c0 to %n step %c1 : i32 {
    %v = warp.load_components %y[%k, %k] : !warp.array<2 x f32>, i32, i32 -> f32
    %next = arith.addi %k, %c1 : i32
    warp.store_components(%v), %y[%k, %next] : (f32), !warp.array<2 x f32>, i32, i32
  }
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 3, non_negative = 4,
      lanes = 1>

// Arrays may overlap: the store to the other one may change the element.
// CHECK-LABEL: func.func @overlapping
// CHECK-NOT: iter_args
// CHECK: return
func.func @overlapping(%y: !warp.array<2 x f32>, %z: !warp.array<2 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  scf.for %k = %c0 to %n step %c1 : i32 {
    %v = warp.load_components %y[%i, %k] : !warp.array<2 x f32>, i32, i32 -> f32
    %next = arith.addi %k, %c1 : i32
    warp.store_components(%v), %y[%i, %next] : (f32), !warp.array<2 x f32>, i32, i32
    warp.store_components(%v), %z[%i, %next] : (f32), !warp.array<2 x f32>, i32, i32
  }
  return
}

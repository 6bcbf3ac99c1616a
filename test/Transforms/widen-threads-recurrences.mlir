// RUN: warp-opt %s --split-input-file --warp-form-launch --warp-widen-threads \
// RUN:   | FileCheck %s

#cpu = #warp.variant<target = <name = "cpu", bits = 512>, packed = 3, non_negative = 4, disjoint = true>

// An element is read one iteration after it is written, so no compiler makes
// vectors of the iterations: lanes do. Read in the same iteration, or before
// any iteration writes it, it leaves the loop a stream.
// CHECK-LABEL: func.func @recurrence
// CHECK-SAME: lanes = 32
// CHECK-LABEL: func.func @in_place
// CHECK-NOT: lanes =
// CHECK-LABEL: func.func @from_behind
// CHECK-NOT: lanes =
func.func @recurrence(%x: !warp.array<2 x f32>, %y: !warp.array<2 x f32>, %n: i32)
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

#cpu = #warp.variant<target = <name = "cpu", bits = 512>, packed = 3, non_negative = 4, disjoint = true>

func.func @in_place(%x: !warp.array<2 x f32>, %y: !warp.array<2 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  scf.for %k = %c0 to %n step %c1 : i32 {
    %v = warp.load_components %y[%i, %k] : !warp.array<2 x f32>, i32, i32 -> f32
    %e = math.exp %v : f32
    warp.store_components(%e), %y[%i, %k] : (f32), !warp.array<2 x f32>, i32, i32
  }
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 512>, packed = 3, non_negative = 4, disjoint = true>

func.func @from_behind(%x: !warp.array<2 x f32>, %y: !warp.array<2 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  scf.for %k = %c0 to %n step %c1 : i32 {
    %next = arith.addi %k, %c1 : i32
    %v = warp.load_components %y[%i, %next] : !warp.array<2 x f32>, i32, i32 -> f32
    %e = math.exp %v : f32
    warp.store_components(%e), %y[%i, %k] : (f32), !warp.array<2 x f32>, i32, i32
  }
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 512>, packed = 3, non_negative = 4, disjoint = true>

// The reduction of large arguments is a branch, which keeps a compiler from
// making vectors of the iterations.
// CHECK-LABEL: func.func @sines
// CHECK-SAME: lanes = 32
// CHECK-LABEL: func.func @exponentials
// CHECK-NOT: lanes =
func.func @sines(%x: !warp.array<2 x f32>, %y: !warp.array<2 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  scf.for %k = %c0 to %n step %c1 : i32 {
    %v = warp.load_components %x[%i, %k] : !warp.array<2 x f32>, i32, i32 -> f32
    %e = math.sin %v : f32
    warp.store_components(%e), %y[%i, %k] : (f32), !warp.array<2 x f32>, i32, i32
  }
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 512>, packed = 3, non_negative = 4, disjoint = true>

func.func @exponentials(%x: !warp.array<2 x f32>, %y: !warp.array<2 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  scf.for %k = %c0 to %n step %c1 : i32 {
    %v = warp.load_components %x[%i, %k] : !warp.array<2 x f32>, i32, i32 -> f32
    %e = math.exp %v : f32
    warp.store_components(%e), %y[%i, %k] : (f32), !warp.array<2 x f32>, i32, i32
  }
  return
}

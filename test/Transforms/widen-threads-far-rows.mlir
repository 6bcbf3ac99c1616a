// RUN: warp-opt %s --split-input-file --warp-form-launch --warp-widen-threads \
// RUN:   | FileCheck %s

#near = #warp.variant<target = <name = "cpu", bits = 512>, packed = 3, non_negative = 4, disjoint = true>

// Rows 2 KiB apart fall into one set of a cache, which has room for 8 lines.
// CHECK-LABEL: func.func @near
// CHECK-SAME: size_facts = 64
// CHECK-SAME: lanes = 32
// CHECK-LABEL: func.func @far
// CHECK-SAME: lanes = 8
// CHECK-LABEL: func.func @columns
// CHECK-NOT: size_facts
func.func @near(%x: !warp.array<2 x f32>, %y: !warp.array<2 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #near} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %zero = arith.constant 0.0 : f32
  %last = scf.for %k = %c0 to %n step %c1 iter_args(%c = %zero) -> (f32) : i32 {
    %v = warp.load_components %x[%i, %k] : !warp.array<2 x f32>, i32, i32 -> f32
    %a = arith.addf %v, %c : f32
    %e = math.exp %a : f32
    warp.store_components(%e), %y[%i, %k] : (f32), !warp.array<2 x f32>, i32, i32
    scf.yield %e : f32
  }
  return
}

// -----

#far = #warp.variant<target = <name = "cpu", bits = 512>, packed = 3, non_negative = 4, disjoint = true, far_rows = true>

func.func @far(%x: !warp.array<2 x f32>, %y: !warp.array<2 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #far} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %zero = arith.constant 0.0 : f32
  %last = scf.for %k = %c0 to %n step %c1 iter_args(%c = %zero) -> (f32) : i32 {
    %v = warp.load_components %x[%i, %k] : !warp.array<2 x f32>, i32, i32 -> f32
    %a = arith.addf %v, %c : f32
    %e = math.exp %a : f32
    warp.store_components(%e), %y[%i, %k] : (f32), !warp.array<2 x f32>, i32, i32
    scf.yield %e : f32
  }
  return
}

// -----

#far = #warp.variant<target = <name = "cpu", bits = 512>, packed = 3, non_negative = 4, disjoint = true, far_rows = true>

// Neighbouring lanes have neighbouring elements here.
func.func @columns(%x: !warp.array<2 x f32>, %y: !warp.array<2 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #far} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %zero = arith.constant 0.0 : f32
  %last = scf.for %k = %c0 to %n step %c1 iter_args(%c = %zero) -> (f32) : i32 {
    %v = warp.load_components %x[%k, %i] : !warp.array<2 x f32>, i32, i32 -> f32
    %a = arith.addf %v, %c : f32
    %e = math.exp %a : f32
    warp.store_components(%e), %y[%k, %i] : (f32), !warp.array<2 x f32>, i32, i32
    scf.yield %e : f32
  }
  return
}

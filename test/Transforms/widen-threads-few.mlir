// RUN: warp-opt %s --split-input-file --warp-form-launch --warp-widen-threads \
// RUN:   | FileCheck %s

#many = #warp.variant<target = <name = "cpu", bits = 512>, packed = 7, non_negative = 8, disjoint = true>

// Sums of gathered elements gain where all lanes have a thread.
// CHECK-LABEL: func.func @many
// CHECK-SAME: size_facts = 2, lanes = 32
// Most lanes of a few threads are idle.
// CHECK-LABEL: func.func @few
// CHECK-SAME: few threads, of which much is done one by one
// CHECK-SAME: #warp.schedule<size_facts = 2>
// Arithmetic gains with a quarter of the lanes, too.
// CHECK-LABEL: func.func @arithmetic
// CHECK-SAME: #warp.schedule<lanes = 64>
func.func @many(%at: !warp.array<1 x si32>, %x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #many} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %zero = arith.constant 0.0 : f32
  %first = warp.load_components %at[%i] : !warp.array<1 x si32>, i32 -> i32
  %sum = scf.for %k = %c0 to %n step %c1 iter_args(%c = %zero) -> (f32) : i32 {
    %j = arith.addi %first, %k : i32
    %v = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
    %far = arith.muli %j, %first : i32
    %w = warp.load_components %x[%far] : !warp.array<1 x f32>, i32 -> f32
    %u = arith.mulf %w, %v : f32
    %a = arith.addf %u, %c : f32
    scf.yield %a : f32
  }
  warp.store_components(%sum), %y[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#few = #warp.variant<target = <name = "cpu", bits = 512>, packed = 7, non_negative = 8, disjoint = true, underfilled = true>

func.func @few(%at: !warp.array<1 x si32>, %x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #few} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %zero = arith.constant 0.0 : f32
  %first = warp.load_components %at[%i] : !warp.array<1 x si32>, i32 -> i32
  %sum = scf.for %k = %c0 to %n step %c1 iter_args(%c = %zero) -> (f32) : i32 {
    %j = arith.addi %first, %k : i32
    %v = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
    %far = arith.muli %j, %first : i32
    %w = warp.load_components %x[%far] : !warp.array<1 x f32>, i32 -> f32
    %u = arith.mulf %w, %v : f32
    %a = arith.addf %u, %c : f32
    scf.yield %a : f32
  }
  warp.store_components(%sum), %y[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#few = #warp.variant<target = <name = "cpu", bits = 512>, packed = 3, non_negative = 4, disjoint = true, underfilled = true>

func.func @arithmetic(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #few} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %sum = scf.for %k = %c0 to %n step %c1 iter_args(%c = %v) -> (f32) : i32 {
    %w = arith.mulf %c, %v : f32
    %a = arith.addf %w, %c : f32
    scf.yield %a : f32
  }
  warp.store_components(%sum), %y[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

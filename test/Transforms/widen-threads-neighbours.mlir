// RUN: warp-opt %s --split-input-file --warp-form-launch \
// RUN:     --warp-widen-threads | FileCheck %s

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 3,
      lanes = 4>

// An index that is kept within bounds follows the threads in most vectors, so
// lanes ask first.
// CHECK-LABEL: func.func @clamped
// CHECK: warp.load_lanes gather %arg0[{{.*}}warp.neighbours
func.func @clamped(%x: !warp.array<1 x f32> {warp.packed},
                   %y: !warp.array<1 x f32> {warp.packed})
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %n = warp.dim %x, 0 : !warp.array<1 x f32> -> i32
  %last = arith.subi %n, %c1 : i32
  %before = arith.subi %i, %c1 : i32
  %low = arith.maxsi %before, %c0 : i32
  %in = arith.minsi %low, %last : i32
  %v = warp.load_components %x[%in] : !warp.array<1 x f32>, i32 -> f32
  warp.store_components(%v), %y[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 3,
      lanes = 4>

// So does one that starts again after a row, with the number of that row.
// CHECK-LABEL: func.func @rows
// CHECK: warp.load_lanes gather %arg0[{{.*}}warp.neighbours
func.func @rows(%x: !warp.array<2 x f32> {warp.packed},
                %y: !warp.array<1 x f32> {warp.packed}, %w: i32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %row = arith.divui %i, %w : i32
  %column = arith.remui %i, %w : i32
  %v = warp.load_components %x[%row, %column]
    : !warp.array<2 x f32>, i32, i32 -> f32
  warp.store_components(%v), %y[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 7, non_negative = 4,
      lanes = 4>

// An index out of an array may be anything: nothing is asked.
// CHECK-LABEL: func.func @indirect
// CHECK: warp.load_lanes gather %arg0
// CHECK-NOT: warp.neighbours
func.func @indirect(%x: !warp.array<1 x f32> {warp.packed},
                    %y: !warp.array<1 x f32> {warp.packed},
                    %at: !warp.array<1 x si32> {warp.packed})
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %j = warp.load_components %at[%i] : !warp.array<1 x si32>, i32 -> i32
  %v = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
  warp.store_components(%v), %y[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// RUN: warp-opt %s --split-input-file --warp-form-launch --warp-widen-threads \
// RUN:   | FileCheck %s
// RUN: sed 's/f32/f64/g' %s \
// RUN:   | warp-opt --split-input-file --warp-form-launch --warp-widen-threads \
// RUN:   | FileCheck %s --check-prefix=WIDE

#cpu = #warp.variant<target = <platform = cpu, bits = 512>, contiguous = 1>

// A vector of 512 bits has 16 floats or 8 doubles; two of them in turn hide the
// latency of a short body.
// CHECK-LABEL: func.func @arithmetic
// CHECK: lanes = 32
// WIDE-LABEL: func.func @arithmetic
// WIDE: lanes = 16
func.func @arithmetic(%x: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %w = math.sqrt %v : f32
  %u = arith.divf %w, %v : f32
  warp.store_components(%u), %x[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <platform = cpu, bits = 256>, contiguous = 1>

// Half as many with 256 bits.
// CHECK-LABEL: func.func @small
// CHECK: lanes = 16
// WIDE-LABEL: func.func @small
// WIDE: lanes = 8
func.func @small(%x: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %w = math.sqrt %v : f32
  warp.store_components(%w), %x[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <platform = cpu, bits = 512>>

// A histogram is updates alone, which lanes make one by one. With much to
// compute for each of them lanes are worth it.
// CHECK-LABEL: func.func @histogram
// CHECK-NOT: lanes =
// CHECK-LABEL: func.func @polynomial
// CHECK: lanes =
// WIDE-LABEL: func.func @histogram
// WIDE-NOT: lanes =
// WIDE-LABEL: func.func @polynomial
// WIDE: lanes =
func.func @histogram(%at: !warp.array<1 x si32>, %sum: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %one = arith.constant 1.0 : f32
  %j = warp.load_components %at[%i] : !warp.array<1 x si32>, i32 -> i32
  %old = warp.atomic_components add(%one), %sum[%j]
    : (f32), !warp.array<1 x f32>, i32 -> f32
  return
}

// -----

#cpu = #warp.variant<target = <platform = cpu, bits = 512>>

func.func @polynomial(%at: !warp.array<1 x si32>, %x: !warp.array<1 x f32>,
                      %sum: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %j = warp.load_components %at[%i] : !warp.array<1 x si32>, i32 -> i32
  %a = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %b = arith.mulf %a, %a : f32
  %c = arith.addf %b, %a : f32
  %d = arith.mulf %c, %b : f32
  %e = arith.addf %d, %a : f32
  %f = arith.mulf %e, %c : f32
  %g = arith.addf %f, %b : f32
  %h = arith.mulf %g, %e : f32
  %k = arith.addf %h, %d : f32
  %v = math.sqrt %k : f32
  %old = warp.atomic_components add(%v), %sum[%j]
    : (f32), !warp.array<1 x f32>, i32 -> f32
  return
}

// -----

#cpu = #warp.variant<target = <platform = cpu, bits = 512>, contiguous = 3>

// A sum over a row: terms of integers may be taken in any order, so the
// iterations of one thread are as good as lanes, which would gather. A sum of
// floats keeps its order.
// CHECK-LABEL: func.func @integers
// CHECK-NOT: lanes =
// CHECK-LABEL: func.func @floats
// CHECK: lanes =
// WIDE-LABEL: func.func @integers
// WIDE-NOT: lanes =
// WIDE-LABEL: func.func @floats
// WIDE: lanes =
func.func @integers(%a: !warp.array<2 x si8>, %y: !warp.array<1 x si32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %n = warp.dim %a, 1 : !warp.array<2 x si8> -> i32
  %sum = scf.for %k = %c0 to %n step %c1 iter_args(%s = %c0) -> (i32) : i32 {
    %v = warp.load_components %a[%i, %k] : !warp.array<2 x si8>, i32, i32 -> i8
    %w = arith.extsi %v : i8 to i32
    %u = arith.muli %w, %w : i32
    %t = arith.addi %s, %u : i32
    scf.yield %t : i32
  }
  warp.store_components(%sum), %y[%i] : (i32), !warp.array<1 x si32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <platform = cpu, bits = 512>, contiguous = 3>

func.func @floats(%a: !warp.array<2 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %zero = arith.constant 0.0 : f32
  %n = warp.dim %a, 1 : !warp.array<2 x f32> -> i32
  %sum = scf.for %k = %c0 to %n step %c1 iter_args(%s = %zero) -> (f32) : i32 {
    %v = warp.load_components %a[%i, %k] : !warp.array<2 x f32>, i32, i32 -> f32
    %u = arith.mulf %v, %v : f32
    %r = math.sqrt %u : f32
    %t = arith.addf %s, %r : f32
    scf.yield %t : f32
  }
  warp.store_components(%sum), %y[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

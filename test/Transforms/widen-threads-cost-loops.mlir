// RUN: warp-opt %s --split-input-file --warp-form-launch --warp-widen-threads \
// RUN:   | FileCheck %s
// RUN: sed 's/f32/f64/g' %s \
// RUN:   | warp-opt --split-input-file --warp-form-launch --warp-widen-threads \
// RUN:   | FileCheck %s --check-prefix=WIDE

#cpu = #warp.variant<target = <name = "cpu", bits = 512>, packed = 3, non_negative = 2>

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

#cpu = #warp.variant<target = <name = "cpu", bits = 512>, packed = 3, non_negative = 2>

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

// -----

// A loop whose iterations are one long chain is done for two vectors in turn,
// although it is not short; operations that need not wait fill one alone.
// CHECK-LABEL: func.func @chain
// CHECK: lanes = 32
// CHECK-LABEL: func.func @tree
// CHECK: lanes = 16
// WIDE-LABEL: func.func @chain
// WIDE: lanes = 16
// WIDE-LABEL: func.func @tree
// WIDE: lanes = 8

#cpu = #warp.variant<target = <name = "cpu", bits = 512>, packed = 3, non_negative = 2>

func.func @chain(%x: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %last = scf.for %k = %c0 to %n step %c1 iter_args(%s = %v) -> (f32) : i32 {
    %a0 = arith.addf %s, %v : f32
    %p1 = arith.mulf %a0, %a0 : f32
    %a1 = arith.addf %p1, %v : f32
    %p2 = arith.mulf %a1, %a1 : f32
    %a2 = arith.addf %p2, %v : f32
    %p3 = arith.mulf %a2, %a2 : f32
    %a3 = arith.addf %p3, %v : f32
    %p4 = arith.mulf %a3, %a3 : f32
    %a4 = arith.addf %p4, %v : f32
    %p5 = arith.mulf %a4, %a4 : f32
    %a5 = arith.addf %p5, %v : f32
    %p6 = arith.mulf %a5, %a5 : f32
    %a6 = arith.addf %p6, %v : f32
    %p7 = arith.mulf %a6, %a6 : f32
    %a7 = arith.addf %p7, %v : f32
    %p8 = arith.mulf %a7, %a7 : f32
    %a8 = arith.addf %p8, %v : f32
    %p9 = arith.mulf %a8, %a8 : f32
    %a9 = arith.addf %p9, %v : f32
    %p10 = arith.mulf %a9, %a9 : f32
    %a10 = arith.addf %p10, %v : f32
    %p11 = arith.mulf %a10, %a10 : f32
    %a11 = arith.addf %p11, %v : f32
    %p12 = arith.mulf %a11, %a11 : f32
    %a12 = arith.addf %p12, %v : f32
    %p13 = arith.mulf %a12, %a12 : f32
    %a13 = arith.addf %p13, %v : f32
    %p14 = arith.mulf %a13, %a13 : f32
    %a14 = arith.addf %p14, %v : f32
    %p15 = arith.mulf %a14, %a14 : f32
    %a15 = arith.addf %p15, %v : f32
    %p16 = arith.mulf %a15, %a15 : f32
    %a16 = arith.addf %p16, %v : f32
    %p17 = arith.mulf %a16, %a16 : f32
    %a17 = arith.addf %p17, %v : f32
    %p18 = arith.mulf %a17, %a17 : f32
    %a18 = arith.addf %p18, %v : f32
    %p19 = arith.mulf %a18, %a18 : f32
    %a19 = arith.addf %p19, %v : f32
    %p20 = arith.mulf %a19, %a19 : f32
    %a20 = arith.addf %p20, %v : f32
    %p21 = arith.mulf %a20, %a20 : f32
    %a21 = arith.addf %p21, %v : f32
    %p22 = arith.mulf %a21, %a21 : f32
    %a22 = arith.addf %p22, %v : f32
    %p23 = arith.mulf %a22, %a22 : f32
    %a23 = arith.addf %p23, %v : f32
    %p24 = arith.mulf %a23, %a23 : f32
    scf.yield %p24 : f32
  }
  warp.store_components(%last), %x[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 512>, packed = 3, non_negative = 2>

func.func @tree(%x: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %last = scf.for %k = %c0 to %n step %c1 iter_args(%s = %v) -> (f32) : i32 {
    %w0 = arith.constant 0.5 : f32
    %a0 = arith.addf %v, %w0 : f32
    %p0 = arith.mulf %a0, %a0 : f32
    %q0 = arith.mulf %p0, %s : f32
    %w1 = arith.constant 1.5 : f32
    %a1 = arith.addf %v, %w1 : f32
    %p1 = arith.mulf %a1, %a1 : f32
    %q1 = arith.mulf %p1, %s : f32
    %w2 = arith.constant 2.5 : f32
    %a2 = arith.addf %v, %w2 : f32
    %p2 = arith.mulf %a2, %a2 : f32
    %q2 = arith.mulf %p2, %s : f32
    %w3 = arith.constant 3.5 : f32
    %a3 = arith.addf %v, %w3 : f32
    %p3 = arith.mulf %a3, %a3 : f32
    %q3 = arith.mulf %p3, %s : f32
    %w4 = arith.constant 4.5 : f32
    %a4 = arith.addf %v, %w4 : f32
    %p4 = arith.mulf %a4, %a4 : f32
    %q4 = arith.mulf %p4, %s : f32
    %w5 = arith.constant 5.5 : f32
    %a5 = arith.addf %v, %w5 : f32
    %p5 = arith.mulf %a5, %a5 : f32
    %q5 = arith.mulf %p5, %s : f32
    %w6 = arith.constant 6.5 : f32
    %a6 = arith.addf %v, %w6 : f32
    %p6 = arith.mulf %a6, %a6 : f32
    %q6 = arith.mulf %p6, %s : f32
    %w7 = arith.constant 7.5 : f32
    %a7 = arith.addf %v, %w7 : f32
    %p7 = arith.mulf %a7, %a7 : f32
    %q7 = arith.mulf %p7, %s : f32
    %w8 = arith.constant 8.5 : f32
    %a8 = arith.addf %v, %w8 : f32
    %p8 = arith.mulf %a8, %a8 : f32
    %q8 = arith.mulf %p8, %s : f32
    %w9 = arith.constant 9.5 : f32
    %a9 = arith.addf %v, %w9 : f32
    %p9 = arith.mulf %a9, %a9 : f32
    %q9 = arith.mulf %p9, %s : f32
    %w10 = arith.constant 10.5 : f32
    %a10 = arith.addf %v, %w10 : f32
    %p10 = arith.mulf %a10, %a10 : f32
    %q10 = arith.mulf %p10, %s : f32
    %w11 = arith.constant 11.5 : f32
    %a11 = arith.addf %v, %w11 : f32
    %p11 = arith.mulf %a11, %a11 : f32
    %q11 = arith.mulf %p11, %s : f32
    %w12 = arith.constant 12.5 : f32
    %a12 = arith.addf %v, %w12 : f32
    %p12 = arith.mulf %a12, %a12 : f32
    %q12 = arith.mulf %p12, %s : f32
    %w13 = arith.constant 13.5 : f32
    %a13 = arith.addf %v, %w13 : f32
    %p13 = arith.mulf %a13, %a13 : f32
    %q13 = arith.mulf %p13, %s : f32
    %r0 = arith.addf %q0, %q1 : f32
    %r1 = arith.addf %q2, %q3 : f32
    %r2 = arith.addf %q4, %q5 : f32
    %r3 = arith.addf %q6, %q7 : f32
    %r4 = arith.addf %q8, %q9 : f32
    %r5 = arith.addf %q10, %q11 : f32
    %r6 = arith.addf %q12, %q13 : f32
    %r7 = arith.addf %r0, %r1 : f32
    %r8 = arith.addf %r2, %r3 : f32
    %r9 = arith.addf %r4, %r5 : f32
    %r10 = arith.addf %r7, %r8 : f32
    %r11 = arith.addf %r9, %r6 : f32
    %r12 = arith.addf %r10, %r11 : f32
    scf.yield %r12 : f32
  }
  warp.store_components(%last), %x[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

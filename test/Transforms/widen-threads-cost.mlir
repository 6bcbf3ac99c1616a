// RUN: warp-opt %s --split-input-file --warp-form-launch --warp-widen-threads \
// RUN:   | FileCheck %s
// RUN: sed 's/f32/f64/g' %s \
// RUN:   | warp-opt --split-input-file --warp-form-launch --warp-widen-threads \
// RUN:   | FileCheck %s --check-prefix=WIDE

#cpu = #warp.variant<target = <name = "cpu", bits = 512>, packed = 1>

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

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 1>

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

#cpu = #warp.variant<target = <name = "cpu", bits = 512>>

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

#cpu = #warp.variant<target = <name = "cpu", bits = 512>>

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

// RUN: warp-opt %s --split-input-file --warp-form-launch \
// RUN:     --warp-widen-threads | FileCheck %s

#cpu = #warp.variant<target = <name = "cpu", bits = 512>, packed = 3, non_negative = 2,
      lanes = 8>

// Integers of 64 bits are divided twice in double precision, and corrected by
// one; a remainder is what the quotient leaves.
// CHECK-LABEL: func.func @long
// CHECK-NOT: arith.remsi
// CHECK: %[[FIRST:.*]] = arith.divf {{.*}} : vector<8xf64>
// CHECK: %[[Q:.*]] = arith.fptoui %[[FIRST]]
// CHECK: %[[PART:.*]] = arith.muli %[[Q]]
// CHECK: %[[LEFT:.*]] = arith.subi %{{.*}}, %[[PART]]
// CHECK: %[[REST:.*]] = arith.sitofp %[[LEFT]]
// CHECK: %[[SECOND:.*]] = arith.divf %[[REST]]
// CHECK: arith.fptosi %[[SECOND]]
// CHECK-NOT: arith.remsi
// CHECK: return
func.func @long(%x: !warp.array<1 x si64>, %y: !warp.array<1 x si64>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %a = warp.load_components %x[%i] : !warp.array<1 x si64>, i32 -> i64
  %b = warp.load_components %y[%i] : !warp.array<1 x si64>, i32 -> i64
  %r = arith.remsi %a, %b : i64
  warp.store_components(%r), %x[%i] : (i64), !warp.array<1 x si64>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 3, non_negative = 2,
      lanes = 4>

// Without instructions for that, lanes divide one by one, and those that are
// not live by one.
// CHECK-LABEL: func.func @without_instructions
// CHECK: arith.select
// CHECK: arith.divsi {{.*}} : vector<4xi64>
// CHECK: return
func.func @without_instructions(%x: !warp.array<1 x si64>,
                                %y: !warp.array<1 x si64>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %a = warp.load_components %x[%i] : !warp.array<1 x si64>, i32 -> i64
  %b = warp.load_components %y[%i] : !warp.array<1 x si64>, i32 -> i64
  %r = arith.divsi %a, %b : i64
  warp.store_components(%r), %x[%i] : (i64), !warp.array<1 x si64>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 512>, packed = 1,
      lanes = 8>

// A divisor that all lanes share becomes one reciprocal, rounded up.
// CHECK-LABEL: func.func @shared
// CHECK: %[[Y:.*]] = arith.sitofp %arg1 : i32 to f64
// CHECK: %[[ONE:.*]] = arith.divf %{{.*}}, %[[Y]] : f64
// CHECK: %[[ABOVE:.*]] = arith.mulf %[[ONE]], %{{.*}} : f64
// CHECK: %[[ALL:.*]] = warp.broadcast %[[ABOVE]] : f64 -> vector<8xf64>
// CHECK: %[[Q:.*]] = arith.mulf %{{.*}}, %[[ALL]] : vector<8xf64>
// CHECK: arith.fptosi %[[Q]] : vector<8xf64> to vector<8xi32>
// CHECK-NOT: arith.divf
// CHECK: return
func.func @shared(%x: !warp.array<1 x si32>, %y: i32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %a = warp.load_components %x[%i] : !warp.array<1 x si32>, i32 -> i32
  %r = arith.remsi %a, %y : i32
  warp.store_components(%r), %x[%i] : (i32), !warp.array<1 x si32>, i32
  return
}

// RUN: warp-opt %s --split-input-file --warp-form-launch \
// RUN:     --warp-widen-threads | FileCheck %s

#cpu = #warp.variant<target = <platform = cpu, bits = 512>, contiguous = 3,
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

#cpu = #warp.variant<target = <platform = cpu, bits = 256>, contiguous = 3,
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

// RUN: warp-opt %s --warp-lower-composites | FileCheck %s

// Division of integers never traps: a zero divisor, and -1, are replaced.
// CHECK-LABEL: func.func @divide
// CHECK-SAME: (%[[A:.*]]: i32, %[[B:.*]]: i32)
func.func @divide(%a: si32, %b: si32) -> si32 {
  // CHECK: %[[SPECIAL:.*]] = arith.cmpi ult
  // CHECK: %[[SAFE:.*]] = arith.select %[[SPECIAL]], %{{.*}}, %[[B]]
  // CHECK: %[[Q:.*]] = arith.divsi %[[A]], %[[SAFE]]
  // CHECK: arith.select %[[SPECIAL]], %{{.*}}, %[[Q]]
  %r = warp.div(%a, %b) : (si32, si32) -> si32
  return %r : si32
}

// A constant divisor needs no guard.
// CHECK-LABEL: func.func @divide_by_constant
// CHECK-NOT: arith.select
// CHECK: arith.divui
// CHECK-NOT: arith.select
// CHECK: arith.remsi
// CHECK-NOT: arith.select
// CHECK: arith.shrsi
func.func @divide_by_constant(%a: ui32, %b: si32) -> (ui32, si32, si32) {
  %seven = warp.constant 7 : ui32
  %three = warp.constant -3 : si32
  %eight = warp.constant 8 : si32
  %0 = warp.div(%a, %seven) : (ui32, ui32) -> ui32
  %1 = warp.mod(%b, %three) : (si32, si32) -> si32
  %2 = warp.floordiv(%b, %eight) : (si32, si32) -> si32
  return %0, %1, %2 : ui32, si32, si32
}

// Comparisons and extensions follow the sign of the type.
// CHECK-LABEL: func.func @signs
func.func @signs(%a: si8, %b: ui8) -> (i1, i1, si32, si32) {
  // CHECK: arith.cmpi slt
  // CHECK: arith.cmpi ult
  // CHECK: arith.extsi
  // CHECK: arith.extui
  %0 = warp.lt(%a, %a) : (si8, si8) -> i1
  %1 = warp.lt(%b, %b) : (ui8, ui8) -> i1
  %2 = warp.cast %a : si8 to si32
  %3 = warp.cast %b : ui8 to si32
  return %0, %1, %2, %3 : i1, i1, si32, si32
}

// Float to integer saturates.
// CHECK-LABEL: func.func @saturate
func.func @saturate(%x: f32, %h: f16) -> (si32, ui8) {
  // CHECK: llvm.call_intrinsic "llvm.fptosi.sat.i32.f32"
  // CHECK: arith.extf
  // CHECK: llvm.call_intrinsic "llvm.fptoui.sat.i8.f32"
  %0 = warp.cast %x : f32 to si32
  %1 = warp.cast %h : f16 to ui8
  return %0, %1 : si32, ui8
}

// Casts between numbers of the same bits leave nothing.
// CHECK-LABEL: func.func @same_bits
// CHECK-SAME: (%[[X:.*]]: i32)
// CHECK-NEXT: return %[[X]]
func.func @same_bits(%x: i32) -> ui32 {
  %0 = warp.cast %x : i32 to si32
  %1 = warp.cast %0 : si32 to ui32
  return %1 : ui32
}

// Floats of 16 bits are computed with in f32 and rounded after each operation.
// CHECK-LABEL: func.func @half
// CHECK-SAME: (%[[X:.*]]: bf16)
func.func @half(%x: bf16) -> bf16 {
  // CHECK: %[[WIDE:.*]] = arith.extf %[[X]] : bf16 to f32
  // CHECK: %[[SUM:.*]] = arith.addf
  // CHECK: %[[ROUNDED:.*]] = arith.truncf %[[SUM]] : f32 to bf16
  // CHECK: arith.extf %[[ROUNDED]]
  // CHECK: math.sin
  %0 = warp.add(%x, %x) : (bf16, bf16) -> bf16
  %1 = warp.sin(%0) : (bf16) -> bf16
  return %1 : bf16
}

// An operation that only moves components does not round.
// CHECK-LABEL: func.func @half_moved
// CHECK-SAME: (%[[X:.*]]: f16, %[[Y:.*]]: f16)
// CHECK: return %[[X]], %[[Y]]
func.func @half_moved(%v: !warp.mat<1x2 x f16>) -> !warp.mat<2x1 x f16> {
  %0 = warp.transpose(%v) : (!warp.mat<1x2 x f16>) -> !warp.mat<2x1 x f16>
  return %0 : !warp.mat<2x1 x f16>
}

// A scalar stands beside each component.
// CHECK-LABEL: func.func @scale
// CHECK-SAME: (%[[X:.*]]: f32, %[[Y:.*]]: f32, %[[S:.*]]: f32)
func.func @scale(%v: !warp.vec<2 x f32>, %s: f32) -> !warp.vec<2 x f32> {
  // CHECK: %[[A:.*]] = arith.mulf %[[S]], %[[X]]
  // CHECK: %[[B:.*]] = arith.mulf %[[S]], %[[Y]]
  // CHECK: return %[[A]], %[[B]]
  %r = warp.mul(%s, %v) : (f32, !warp.vec<2 x f32>) -> !warp.vec<2 x f32>
  return %r : !warp.vec<2 x f32>
}

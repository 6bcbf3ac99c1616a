// RUN: warp-opt %s --canonicalize | FileCheck %s

// Integers wrap around.
// CHECK-LABEL: func.func @integers
// CHECK-DAG: %[[MIN:.*]] = warp.constant -2147483648 : si32
// CHECK-DAG: %[[ONE:.*]] = warp.constant 1 : ui8
// CHECK-DAG: %[[MOST:.*]] = warp.constant 4294967295 : ui32
// CHECK: return %[[MIN]], %[[ONE]], %[[MOST]], %[[MIN]]
func.func @integers() -> (si32, ui8, ui32, si32) {
  %max = warp.constant 2147483647 : si32
  %one = warp.constant 1 : si32
  %0 = warp.add(%max, %one) : (si32, si32) -> si32
  %255 = warp.constant 255 : ui8
  %1 = warp.mul(%255, %255) : (ui8, ui8) -> ui8
  %zero = warp.constant 0 : ui32
  %uone = warp.constant 1 : ui32
  %2 = warp.sub(%zero, %uone) : (ui32, ui32) -> ui32
  %3 = warp.neg(%0) : (si32) -> si32
  return %0, %1, %2, %3 : si32, ui8, ui32, si32
}

// Floats round once, to nearest even, overflow to infinity and keep NaN.
// CHECK-LABEL: func.func @floats
// CHECK-DAG: %[[SUM:.*]] = warp.constant 3.000000e-01 : f32
// CHECK-DAG: %[[HALF:.*]] = warp.constant 2.048000e+03 : f16
// CHECK-DAG: %[[INF:.*]] = warp.constant 0x7C00 : f16
// CHECK-DAG: %[[NAN:.*]] = warp.constant 0x7FC00000 : f32
// CHECK-DAG: %[[NZERO:.*]] = warp.constant -0.000000e+00 : f64
// CHECK: return %[[SUM]], %[[HALF]], %[[INF]], %[[NAN]], %[[NZERO]]
func.func @floats() -> (f32, f16, f16, f32, f64) {
  %a = warp.constant 0.1 : f32
  %b = warp.constant 0.2 : f32
  %0 = warp.add(%a, %b) : (f32, f32) -> f32
  %c = warp.constant 2048.0 : f16
  %d = warp.constant 1.0 : f16
  %1 = warp.add(%c, %d) : (f16, f16) -> f16
  %2 = warp.mul(%c, %c) : (f16, f16) -> f16
  %inf = warp.constant 0x7F800000 : f32
  %3 = warp.sub(%inf, %inf) : (f32, f32) -> f32
  %z = warp.constant 0.0 : f64
  %4 = warp.neg(%z) : (f64) -> f64
  return %0, %1, %2, %3, %4 : f32, f16, f16, f32, f64
}

// A fact that holds for every value is used.
// CHECK-LABEL: func.func @identities(
// CHECK-SAME: %[[I:.*]]: si32, %[[X:.*]]: f32, %[[V:.*]]: !warp.vec<3 x f32>)
// CHECK-NEXT: %[[ZERO:.*]] = warp.constant 0 : si32
// CHECK-NEXT: return %[[I]], %[[I]], %[[I]], %[[ZERO]], %[[X]], %[[X]], %[[X]], %[[V]], %[[V]]
func.func @identities(%i: si32, %x: f32, %v: !warp.vec<3 x f32>)
    -> (si32, si32, si32, si32, f32, f32, f32, !warp.vec<3 x f32>, !warp.vec<3 x f32>) {
  %0 = warp.constant 0 : si32
  %1 = warp.constant 1 : si32
  %one = warp.constant 1.0 : f32
  %zero = warp.constant 0.0 : f32
  %a = warp.add(%0, %i) : (si32, si32) -> si32
  %b = warp.sub(%i, %0) : (si32, si32) -> si32
  %c = warp.mul(%1, %i) : (si32, si32) -> si32
  %d = warp.mul(%i, %0) : (si32, si32) -> si32
  %e = warp.mul(%x, %one) : (f32, f32) -> f32
  %f = warp.sub(%x, %zero) : (f32, f32) -> f32
  %g = warp.pos(%x) : (f32) -> f32
  %n = warp.neg(%v) : (!warp.vec<3 x f32>) -> !warp.vec<3 x f32>
  %h = warp.neg(%n) : (!warp.vec<3 x f32>) -> !warp.vec<3 x f32>
  %k = warp.mul(%v, %one) : (!warp.vec<3 x f32>, f32) -> !warp.vec<3 x f32>
  return %a, %b, %c, %d, %e, %f, %g, %h, %k : si32, si32, si32, si32, f32, f32, f32, !warp.vec<3 x f32>, !warp.vec<3 x f32>
}

// x + 0 turns -0 into 0, 0 x is NaN for infinite x, and 1 v is a vector.
// CHECK-LABEL: func.func @no_identities
// CHECK: warp.add
// CHECK: warp.mul
func.func @no_identities(%x: f32) -> (f32, f32) {
  %zero = warp.constant 0.0 : f32
  %a = warp.add(%x, %zero) : (f32, f32) -> f32
  %b = warp.mul(%x, %zero) : (f32, f32) -> f32
  return %a, %b : f32, f32
}

// CHECK-LABEL: func.func @logic(
// CHECK-SAME: %[[B:.*]]: i1, %[[I:.*]]: si32)
// CHECK: %[[TRUE:.*]] = warp.constant true
// CHECK: %[[N:.*]] = warp.unot(%[[I]])
// CHECK: return %[[B]], %[[TRUE]], %[[N]]
func.func @logic(%b: i1, %i: si32) -> (i1, i1, i1) {
  %0 = warp.unot(%b) : (i1) -> i1
  %1 = warp.unot(%0) : (i1) -> i1
  %zero = warp.constant 0 : si32
  %2 = warp.unot(%zero) : (si32) -> i1
  %3 = warp.unot(%i) : (si32) -> i1
  return %1, %2, %3 : i1, i1, i1
}

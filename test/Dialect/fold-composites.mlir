// RUN: warp-opt %s --canonicalize | FileCheck %s

!v3 = !warp.vec<3 x f32>
!m22 = !warp.mat<2x2 x f32>
!s = !warp.struct<"S", {x: f32, y: f32}>

// CHECK-LABEL: func.func @extract_of_construct(
// CHECK-SAME: %[[X:[^:]*]]: f32, %[[Y:[^:]*]]: f32, %[[V:[^:]*]]: !warp.vec<2 x f32>)
// CHECK: %[[ZERO:.*]] = warp.constant 0.000000e+00 : f32
// CHECK: return %[[Y]], %[[X]], %[[X]], %[[ZERO]], %[[Y]]
func.func @extract_of_construct(%x: f32, %y: f32, %v: !warp.vec<2 x f32>) -> (f32, f32, f32, f32, f32) {
  %0 = warp.constant 0 : si32
  %1 = warp.constant 1 : si32
  %last = warp.constant -1 : si32
  %a = warp.construct(%x, %y, %x) : (f32, f32, f32) -> !v3
  %b = warp.extract %a[%1] : !v3, si32 -> f32
  %c = warp.extract %a[%last] : !v3, si32 -> f32
  %d = warp.construct(%x) : (f32) -> !m22
  %e = warp.extract %d[%1, %0] : !m22, si32, si32 -> f32
  %f = warp.construct() : () -> !m22
  %g = warp.extract %f[%0, %last] : !m22, si32, si32 -> f32
  %h = warp.construct(%v, %y) : (!warp.vec<2 x f32>, f32) -> !v3
  %i = warp.extract %h[%last] : !v3, si32 -> f32
  return %b, %c, %e, %g, %i : f32, f32, f32, f32, f32
}

// An insert elsewhere is passed by; one at a varying index is not.
// CHECK-LABEL: func.func @extract_of_insert(
// CHECK-SAME: %[[V:[^:]*]]: !warp.vec<3 x f32>, %[[X:[^:]*]]: f32, %[[I:[^:]*]]: si32)
// CHECK-DAG: %[[ONE:.*]] = warp.constant 1 : si32
// CHECK-DAG: %[[W:.*]] = warp.insert %[[X]], %[[V]][%[[I]]]
// CHECK-DAG: %[[A:.*]] = warp.extract %[[V]][%[[ONE]]]
// CHECK-DAG: %[[B:.*]] = warp.extract %[[W]][%[[ONE]]]
// CHECK: return %[[X]], %[[A]], %[[B]]
func.func @extract_of_insert(%v: !v3, %x: f32, %i: si32) -> (f32, f32, f32) {
  %0 = warp.constant 0 : si32
  %1 = warp.constant 1 : si32
  %w = warp.insert %x, %v[%0] : f32, !v3, si32
  %a = warp.extract %w[%0] : !v3, si32 -> f32
  %b = warp.extract %w[%1] : !v3, si32 -> f32
  %u = warp.insert %x, %v[%i] : f32, !v3, si32
  %c = warp.extract %u[%1] : !v3, si32 -> f32
  return %a, %b, %c : f32, f32, f32
}

// An index out of range stays for the debug mode to report.
// CHECK-LABEL: func.func @out_of_range
// CHECK: warp.extract
// CHECK: warp.extract
func.func @out_of_range(%x: f32) -> (f32, f32) {
  %3 = warp.constant 3 : si32
  %most = warp.constant 18446744073709551615 : ui64
  %v = warp.construct(%x, %x, %x) : (f32, f32, f32) -> !v3
  %0 = warp.extract %v[%3] : !v3, si32 -> f32
  %1 = warp.extract %v[%most] : !v3, ui64 -> f32
  return %0, %1 : f32, f32
}

// CHECK-LABEL: func.func @structs(
// CHECK-SAME: %[[S:[^:]*]]: !S, %[[X:[^:]*]]: f32, %[[Y:[^:]*]]: f32)
// CHECK: %[[Z:.*]] = warp.struct_get %[[S]]["y"]
// CHECK: return %[[Y]], %[[X]], %[[Z]]
func.func @structs(%s: !s, %x: f32, %y: f32) -> (f32, f32, f32) {
  %0 = warp.struct_create(%x, %y) : (f32, f32) -> !s
  %1 = warp.struct_get %0["y"] : !s -> f32
  %2 = warp.struct_set %x, %s["x"] : f32, !s
  %3 = warp.struct_get %2["x"] : !s -> f32
  %4 = warp.struct_get %2["y"] : !s -> f32
  return %1, %3, %4 : f32, f32, f32
}

// Reads of arrays are kept in order; what is not used goes.
// CHECK-LABEL: func.func @dead
// CHECK-NEXT: return
func.func @dead(%v: !v3, %a: !warp.array<1 x f32>, %i: si32) {
  %0 = warp.length(%v) : (!v3) -> f32
  %1 = warp.load %a[%i] : !warp.array<1 x f32>, si32 -> f32
  %2 = warp.tid : si32
  return
}

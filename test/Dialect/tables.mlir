// RUN: warp-opt %s --split-input-file --verify-roundtrip
// RUN: warp-opt %s --split-input-file --canonicalize --warp-resolve-derivatives | FileCheck %s

// A constant index is folded: from the end below zero, the last out of bounds.
// CHECK-LABEL: func.func @known
// CHECK-DAG: %[[A:.*]] = warp.constant 2.000000e+00 : f32
// CHECK-DAG: %[[B:.*]] = warp.constant 3.000000e+00 : f32
// CHECK-DAG: %[[C:.*]] = warp.constant 4.000000e+00 : f32
// CHECK-DAG: %[[D:.*]] = warp.constant true
// CHECK-DAG: %[[E:.*]] = warp.constant 200 : ui8
// CHECK: return %[[A]], %[[B]], %[[C]], %[[D]], %[[E]]
func.func @known(%i: si32) -> (f32, f32, f32, i1, ui8) {
  %0 = warp.constant 0 : si32
  %1 = warp.constant 1 : ui32
  %last = warp.constant -1 : si64
  %far = warp.constant 9 : si32
  %a = warp.table_get dense<[[1.0, 2.0], [3.0, 4.0]]> : tensor<2x2xf32> [%0, %1] : si32, ui32 -> f32
  %b = warp.table_get dense<[[1.0, 2.0], [3.0, 4.0]]> : tensor<2x2xf32> [%last, %0] : si64, si32 -> f32
  %c = warp.table_get dense<[[1.0, 2.0], [3.0, 4.0]]> : tensor<2x2xf32> [%far, %far] : si32, si32 -> f32
  %d = warp.table_get dense<[true, false]> : tensor<2xi1> [%0] : si32 -> i1
  // Equal numbers, at any index.
  %e = warp.table_get dense<200> : tensor<7xui8> [%i] : si32 -> ui8
  return %a, %b, %c, %d, %e : f32, f32, f32, i1, ui8
}

// -----

// A conversion of an element rounds the table once.
// CHECK: #table = dense<{{.*}}> : tensor<9xf32>
// CHECK-LABEL: func.func @converted
// CHECK-NEXT: %[[X:.*]] = warp.table_get #table[%{{.*}}] : si32 -> f32
// CHECK-NEXT: %[[Y:.*]] = warp.table_get dense<[1.000000e+00, -2.000000e+00]> : tensor<2xf64>[
// CHECK-NEXT: return %[[X]], %[[Y]]
func.func @converted(%i: si32) -> (f32, f64) {
  %a = warp.table_get dense<[0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9]> : tensor<9xf64> [%i] : si32 -> f64
  %b = warp.table_get dense<[1, -2]> : tensor<2xsi8> [%i] : si32 -> si8
  %x = warp.cast %a : f64 to f32
  %y = warp.cast %b : si8 to f64
  return %x, %y : f32, f64
}

// -----

!v10 = !warp.vec<10 x si32>
!m26 = !warp.mat<2x6 x si32>

// A long constant that is indexed at run time is a table; a short one, and one
// whose components are not all known, stays a value.
// CHECK-LABEL: func.func @constant_vector
// CHECK-SAME: %[[I:[^:]*]]: si32, %[[X:[^:]*]]: si32
// CHECK: warp.construct({{.*}}) : {{.*}} -> !warp.vec<10 x si32>
// CHECK: %[[A:.*]] = warp.table_get #table[%[[I]]] {warp.checked} : si32 -> si32
// CHECK: warp.extract %{{.*}}[%[[I]]] : !warp.vec<10 x si32>
// CHECK: warp.extract %{{.*}}[%[[I]]] : !warp.vec<3 x si32>
func.func @constant_vector(%i: si32, %x: si32) -> (si32, si32, si32) {
  %0 = warp.constant 0 : si32
  %1 = warp.constant 1 : si32
  %v = warp.construct(%0, %1, %0, %1, %0, %1, %0, %1, %1, %1) : (si32, si32, si32, si32, si32, si32, si32, si32, si32, si32) -> !v10
  %w = warp.construct(%0, %1, %0, %1, %0, %1, %0, %1, %1, %x) : (si32, si32, si32, si32, si32, si32, si32, si32, si32, si32) -> !v10
  %s = warp.construct(%0, %1, %1) : (si32, si32, si32) -> !warp.vec<3 x si32>
  %a = warp.extract %v[%i] {warp.checked} : !v10, si32 -> si32
  %b = warp.extract %w[%i] : !v10, si32 -> si32
  %c = warp.extract %s[%i] : !warp.vec<3 x si32>, si32 -> si32
  return %a, %b, %c : si32, si32, si32
}

// An element of a row is one of the matrix; a row is a vector of elements.
// CHECK-LABEL: func.func @constant_matrix
// CHECK-SAME: %[[I:[^:]*]]: si32, %[[J:[^:]*]]: si32
// CHECK: %[[A:.*]] = warp.table_get #table{{.*}}[%[[I]], %[[J]]] : si32, si32 -> si32
// CHECK-COUNT-6: warp.table_get #table{{.*}}[%[[J]], %{{.*}}] : si32, si32 -> si32
// CHECK: warp.construct
// CHECK-NOT: warp.extract
func.func @constant_matrix(%i: si32, %j: si32) -> (si32, !warp.vec<6 x si32>) {
  %0 = warp.constant 0 : si32
  %1 = warp.constant 1 : si32
  %m = warp.construct(%0, %1, %0, %1, %0, %1, %0, %1, %1, %1, %0, %0) : (si32, si32, si32, si32, si32, si32, si32, si32, si32, si32, si32, si32) -> !m26
  %r = warp.extract %m[%i] : !m26, si32 -> !warp.vec<6 x si32>
  %a = warp.extract %r[%j] : !warp.vec<6 x si32>, si32 -> si32
  %t = warp.extract %m[%j] : !m26, si32 -> !warp.vec<6 x si32>
  return %a, %t : si32, !warp.vec<6 x si32>
}

// A component of a row, too, wherever the row was read.
// CHECK-LABEL: func.func @row
// CHECK-SAME: %[[I:[^:]*]]: si32, %[[J:[^:]*]]: si64
// CHECK: %[[X:.*]] = warp.table_get dense<{{.*}}> : tensor<3x2xf32>[%[[I]], %[[J]]] : si32, si64 -> f32
// CHECK-NEXT: return %[[X]]
func.func @row(%i: si32, %j: si64) -> f32 {
  %0 = warp.constant 0 : si32
  %1 = warp.constant 1 : si32
  %a = warp.table_get dense<[[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]> : tensor<3x2xf32> [%i, %0] : si32, si32 -> f32
  %b = warp.table_get dense<[[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]> : tensor<3x2xf32> [%i, %1] : si32, si32 -> f32
  %r = warp.construct(%a, %b) : (f32, f32) -> !warp.vec<2 x f32>
  %x = warp.extract %r[%j] : !warp.vec<2 x f32>, si64 -> f32
  return %x : f32
}

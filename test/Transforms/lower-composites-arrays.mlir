// RUN: warp-opt %s --warp-lower-composites | FileCheck %s

!v2 = !warp.vec<2 x f32>

// One operation still accesses a whole element.
// CHECK-LABEL: func.func @accesses
// CHECK-SAME: (%[[A:.*]]: !warp.array<1 x !warp.vec<2 x f32>>, %[[I:.*]]: i32)
func.func @accesses(%a: !warp.array<1 x !v2>, %i: si32) {
  // CHECK: %[[V:.*]]:2 = warp.load_components %[[A]][%[[I]]]
  // CHECK-SAME: i32 -> f32, f32
  // CHECK: warp.store_components(%[[V]]#1, %[[V]]#0), %[[A]][%[[I]]]
  // CHECK: warp.atomic_components max(%[[V]]#0, %[[V]]#1), %[[A]][%[[I]]]
  %v = warp.load %a[%i] : !warp.array<1 x !v2>, si32 -> !v2
  %c0 = warp.constant 0 : si32
  %c1 = warp.constant 1 : si32
  %x = warp.extract %v[%c0] : !v2, si32 -> f32
  %y = warp.extract %v[%c1] : !v2, si32 -> f32
  %w = warp.construct(%y, %x) : (f32, f32) -> !v2
  warp.store %w, %a[%i] : !v2, !warp.array<1 x !v2>, si32
  %old = warp.atomic max %v, %a[%i] : !v2, !warp.array<1 x !v2>, si32 -> !v2
  return
}

// Indices keep their value as signed numbers of 32 or 64 bits.
// CHECK-LABEL: func.func @indices
// CHECK-SAME: (%[[A:.*]]: !warp.array<3 x si8>, %[[I:.*]]: i16, %[[J:.*]]: i32, %[[K:.*]]: i64)
func.func @indices(%a: !warp.array<3 x si8>, %i: si16, %j: ui32, %k: si64)
    -> si8 {
  // CHECK-DAG: %[[WIDE:.*]] = arith.extsi %[[I]] : i16 to i32
  // CHECK-DAG: %[[LONG:.*]] = arith.extui %[[J]] : i32 to i64
  // CHECK: warp.load_components %[[A]][%[[WIDE]], %[[LONG]], %[[K]]]
  // CHECK-SAME: i32, i64, i64 -> i8
  %r = warp.load %a[%i, %j, %k]
    : !warp.array<3 x si8>, si16, ui32, si64 -> si8
  return %r : si8
}

// Views stay; what they give lost its sign.
// CHECK-LABEL: func.func @views
func.func @views(%a: !warp.array<2 x !v2>, %i: si32) -> si32 {
  // CHECK: warp.view %{{.*}}[%{{.*}}] : !warp.array<2 x !warp.vec<2 x f32>>, i32
  // CHECK: warp.component_view %{{.*}}[%{{.*}}] : !warp.array<1 x !warp.vec<2 x f32>>, i32
  // CHECK: warp.dim %{{.*}}, 0 : !warp.array<1 x f32> -> i32
  %row = warp.view %a[%i] : !warp.array<2 x !v2>, si32 -> !warp.array<1 x !v2>
  %x = warp.component_view %row[%i] : !warp.array<1 x !v2>, si32
    -> !warp.array<1 x f32>
  %n = warp.dim %x, 0 : !warp.array<1 x f32> -> si32
  return %n : si32
}

// The sign of a result is known even where the operation that stays lost it.
// CHECK-LABEL: func.func @unsigned_old
func.func @unsigned_old(%a: !warp.array<1 x ui32>, %i: si32, %v: ui32) -> f32 {
  // CHECK: %[[OLD:.*]] = warp.atomic_cas
  // CHECK-SAME: -> i32
  // CHECK: arith.uitofp %[[OLD]]
  %old = warp.atomic_cas %v, %v, %a[%i]
    : ui32, ui32, !warp.array<1 x ui32>, si32 -> ui32
  %r = warp.cast %old : ui32 to f32
  return %r : f32
}

// Numbers are printed as C's variable arguments take them.
// CHECK-LABEL: func.func @output
func.func @output(%x: f32, %b: ui8, %c: si16) {
  // CHECK-DAG: %[[X:.*]] = arith.extf %{{.*}} : f32 to f64
  // CHECK-DAG: %[[B:.*]] = arith.extui %{{.*}} : i8 to i32
  // CHECK-DAG: %[[C:.*]] = arith.extsi %{{.*}} : i16 to i32
  // CHECK: warp.printf "%f %u %d"(%[[X]], %[[B]], %[[C]]) : f64, i32, i32
  warp.printf "%f %u %d"(%x, %b, %c) : f32, ui8, si16
  return
}

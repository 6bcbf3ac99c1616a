// RUN: warp-opt %s --warp-lower-composites | FileCheck %s

// CHECK-LABEL: func.func @dot
// CHECK-SAME: (%[[A:.*]]: f32, %[[B:.*]]: f32, %[[C:.*]]: f32, %[[D:.*]]: f32)
func.func @dot(%a: !warp.vec<2 x f32>, %b: !warp.vec<2 x f32>) -> f32 {
  // CHECK: %[[AC:.*]] = arith.mulf %[[A]], %[[C]]
  // CHECK: %[[BD:.*]] = arith.mulf %[[B]], %[[D]]
  // CHECK: arith.addf %[[AC]], %[[BD]]
  %r = warp.dot(%a, %b) : (!warp.vec<2 x f32>, !warp.vec<2 x f32>) -> f32
  return %r : f32
}

// Only a length whose squares leave the range of the type pays for scaling.
// CHECK-LABEL: func.func @length
func.func @length(%v: !warp.vec<3 x f32>) -> f32 {
  // CHECK: %[[RARE:.*]] = arith.cmpi uge
  // CHECK: %[[PLAIN:.*]] = math.sqrt
  // CHECK: scf.if %[[RARE]]
  // CHECK: } else {
  // CHECK-NEXT: scf.yield %[[PLAIN]]
  %r = warp.length(%v) : (!warp.vec<3 x f32>) -> f32
  return %r : f32
}

// A determinant is a difference of products without cancellation error.
// CHECK-LABEL: func.func @determinant
func.func @determinant(%m: !warp.mat<2x2 x f64>) -> f64 {
  // CHECK: %[[PRODUCT:.*]] = arith.mulf
  // CHECK: %[[ERROR:.*]] = math.fma %{{.*}}, %{{.*}}, %[[PRODUCT]]
  // CHECK: %[[DIFFERENCE:.*]] = math.fma
  // CHECK: arith.addf %[[DIFFERENCE]], %[[ERROR]]
  %r = warp.determinant(%m) : (!warp.mat<2x2 x f64>) -> f64
  return %r : f64
}

// A function of the random state returns the number and the next state.
// CHECK-LABEL: func.func @random
// CHECK-SAME: (%[[STATE:.*]]: i32) -> (f32, i32)
func.func @random(%state: ui32) -> (f32, ui32) {
  // CHECK: arith.muli %[[STATE]]
  // CHECK: %[[WORD:.*]] = arith.muli
  // CHECK: %[[NEXT:.*]] = arith.xori %{{.*}}, %[[WORD]]
  // CHECK: %[[UNIT:.*]] = arith.mulf
  // CHECK: return %[[UNIT]], %[[NEXT]] : f32, i32
  %x, %next = warp.randf(%state) : (ui32) -> (f32, ui32)
  return %x, %next : f32, ui32
}

// Rounding that defines a random sequence is not merged with what follows.
// CHECK-LABEL: func.func @random_in_range
func.func @random_in_range(%state: ui32, %low: f32, %high: f32) -> f32 {
  // CHECK: arith.mulf {{.*}} {warp.exact}
  %x, %next = warp.randf(%state, %low, %high) : (ui32, f32, f32) -> (f32, ui32)
  return %x : f32
}

// The rotation of a transform is its last four components.
// CHECK-LABEL: func.func @set_translation
// CHECK-SAME: ({{[^,]*, [^,]*, [^,]*, }}%[[QX:[^:]*]]: f32, {{[^,]*, [^,]*, }}%[[QW:[^:]*]]: f32, %[[X:[^:]*]]: f32,
func.func @set_translation(%t: !warp.transform<f32>, %p: !warp.vec<3 x f32>)
    -> !warp.transform<f32> {
  // CHECK: return %[[X]], {{.*}}, %[[QX]], {{.*}}, %[[QW]] :
  %r = warp.transform_set_translation(%t, %p)
    : (!warp.transform<f32>, !warp.vec<3 x f32>) -> !warp.transform<f32>
  return %r : !warp.transform<f32>
}

// NaN is passed over by a minimum, and a place stays at the first of equals.
// CHECK-LABEL: func.func @extrema
func.func @extrema(%v: !warp.vec<2 x f32>, %w: !warp.vec<2 x ui32>)
    -> (f32, ui32, ui32) {
  // CHECK: arith.minnumf
  // CHECK: arith.maxui
  // CHECK: arith.cmpf olt
  %0 = warp.min(%v) : (!warp.vec<2 x f32>) -> f32
  %1 = warp.max(%w) : (!warp.vec<2 x ui32>) -> ui32
  %2 = warp.argmin(%v) : (!warp.vec<2 x f32>) -> ui32
  return %0, %1, %2 : f32, ui32, ui32
}

// RUN: warp-opt %s | warp-opt | FileCheck %s

!v3 = !warp.vec<3 x f32>
!m23 = !warp.mat<2x3 x f64>

// Letters stand for types and extents; each overload has its own results.
// CHECK-LABEL: func.func @overloads
func.func @overloads(%x: f32, %v: !v3, %m: !m23, %w: !warp.vec<3 x f64>, %i: si32, %b: i1) {
  // CHECK: warp.add(%{{.*}}, %{{.*}}) : (f32, f32) -> f32
  %0 = warp.add(%x, %x) : (f32, f32) -> f32
  // CHECK: warp.mul(%{{.*}}, %{{.*}}) : (!warp.mat<2x3 x f64>, !warp.vec<3 x f64>) -> !warp.vec<2 x f64>
  %1 = warp.mul(%m, %w) : (!m23, !warp.vec<3 x f64>) -> !warp.vec<2 x f64>
  // CHECK: warp.mul(%{{.*}}, %{{.*}}) : (f32, !warp.vec<3 x f32>) -> !warp.vec<3 x f32>
  %2 = warp.mul(%x, %v) : (f32, !v3) -> !v3
  // CHECK: warp.dot(%{{.*}}, %{{.*}}) : (!warp.vec<3 x f32>, !warp.vec<3 x f32>) -> f32
  %3 = warp.dot(%v, %v) : (!v3, !v3) -> f32
  // CHECK: warp.outer(%{{.*}}, %{{.*}}) : (!warp.vec<3 x f64>, !warp.vec<2 x f64>) -> !warp.mat<3x2 x f64>
  %4 = warp.outer(%w, %1) : (!warp.vec<3 x f64>, !warp.vec<2 x f64>) -> !warp.mat<3x2 x f64>
  // CHECK: warp.transpose(%{{.*}}) : (!warp.mat<2x3 x f64>) -> !warp.mat<3x2 x f64>
  %5 = warp.transpose(%m) : (!m23) -> !warp.mat<3x2 x f64>
  // CHECK: warp.lt(%{{.*}}, %{{.*}}) : (si32, si32) -> i1
  %6 = warp.lt(%i, %i) : (si32, si32) -> i1
  // CHECK: warp.where(%{{.*}}, %{{.*}}, %{{.*}}) : (i1, !warp.vec<3 x f32>, !warp.vec<3 x f32>) -> !warp.vec<3 x f32>
  %7 = warp.where(%b, %v, %v) : (i1, !v3, !v3) -> !v3
  // CHECK: warp.argmin(%{{.*}}) : (!warp.vec<3 x f32>) -> ui32
  %8 = warp.argmin(%v) : (!v3) -> ui32
  return
}

// Several results, and results for operands that are updated.
// CHECK-LABEL: func.func @results
func.func @results(%q: !warp.quat<f32>, %s: ui32, %t: !warp.transform<f32>, %v: !v3) {
  // CHECK: warp.quat_to_axis_angle(%{{.*}}) : (!warp.quat<f32>) -> (!warp.vec<3 x f32>, f32)
  %0:2 = warp.quat_to_axis_angle(%q) : (!warp.quat<f32>) -> (!v3, f32)
  // CHECK: warp.randf(%{{.*}}) : (ui32) -> (f32, ui32)
  %1:2 = warp.randf(%s) : (ui32) -> (f32, ui32)
  // CHECK: warp.transform_set_translation(%{{.*}}, %{{.*}}) : (!warp.transform<f32>, !warp.vec<3 x f32>) -> !warp.transform<f32>
  %2 = warp.transform_set_translation(%t, %v) : (!warp.transform<f32>, !v3) -> !warp.transform<f32>
  return
}

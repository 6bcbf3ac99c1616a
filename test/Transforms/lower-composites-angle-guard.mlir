// RUN: warp-opt %s --warp-lower-composites --canonicalize | FileCheck %s

// The angle of the origin is not NaN, however late its coordinates are known.
// CHECK-LABEL: func.func @origin
// CHECK-DAG: %[[ZERO:.*]] = arith.constant 0.000000e+00 : f32
// CHECK-DAG: %[[PI:.*]] = arith.constant -3.14159274 : f32
// CHECK: return %[[ZERO]], %[[PI]]
func.func @origin() -> (f32, f32) {
  %zero = arith.constant 0.0 : f32
  %negative = arith.constant -0.0 : f32
  %two = arith.constant 2.0 : f32
  %y = arith.mulf %two, %zero : f32
  %a = warp.atan2(%y, %zero) : (f32, f32) -> f32
  %b = warp.atan2(%negative, %negative) : (f32, f32) -> f32
  return %a, %b : f32, f32
}

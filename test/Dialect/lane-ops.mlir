// RUN: warp-opt %s | warp-opt | FileCheck %s

// Convergent operations survive a round trip.
// CHECK-LABEL: func.func @meet
func.func @meet(%own: i32, %hint: i32) -> i32 {
  // CHECK: warp.agree %{{.*}}, %{{.*}} : i32
  %u = warp.agree %own, %hint : i32
  return %u : i32
}

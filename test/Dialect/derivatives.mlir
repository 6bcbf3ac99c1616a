// RUN: warp-opt %s | warp-opt | FileCheck %s

// Cotangents go with results of floats, tangents with the first arguments of
// floats.
func.func private @f(%x: f32, %n: si32, %v: !warp.vec<2 x f16>) -> (f32, si32) {
  return %x, %n : f32, si32
}

// CHECK-LABEL: @derivatives
func.func @derivatives(%x: f32, %n: si32, %v: !warp.vec<2 x f16>) {
  // CHECK: warp.vjp @f(%{{.*}}, %{{.*}}, %{{.*}}) of(%{{.*}}) : (f32, si32, !warp.vec<2 x f16>), (f32) -> (f32, !warp.vec<2 x f16>)
  %0:2 = warp.vjp @f(%x, %n, %v) of (%x) : (f32, si32, !warp.vec<2 x f16>), (f32) -> (f32, !warp.vec<2 x f16>)
  // CHECK: warp.vjp @f({{.*}}) of({{.*}}) {arrays}
  %1:2 = warp.vjp @f(%x, %n, %v) of (%x) {arrays} : (f32, si32, !warp.vec<2 x f16>), (f32) -> (f32, !warp.vec<2 x f16>)
  // CHECK: warp.jvp @f({{.*}}) of(%{{.*}}) : (f32, si32, !warp.vec<2 x f16>), (f32) -> (f32)
  %2 = warp.jvp @f(%x, %n, %v) of (%x) : (f32, si32, !warp.vec<2 x f16>), (f32) -> (f32)
  // CHECK: warp.jvp @f({{.*}}) of(%{{.*}}, %{{.*}})
  %3 = warp.jvp @f(%x, %n, %v) of (%x, %v) : (f32, si32, !warp.vec<2 x f16>), (f32, !warp.vec<2 x f16>) -> (f32)
  return
}

// Residuals have no cotangents.
func.func private @g(%x: f32) -> (f32, f32) attributes {warp.residuals = 1 : i64} {
  return %x, %x : f32, f32
}

// CHECK-LABEL: @residuals
func.func @residuals(%x: f32) {
  // CHECK: warp.vjp @g
  %0 = warp.vjp @g(%x) of (%x) : (f32), (f32) -> (f32)
  return
}

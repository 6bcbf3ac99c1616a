// RUN: warp-opt %s --split-input-file --warp-differentiate-kernel=mode=forward --canonicalize | FileCheck %s

// The pullback is called once for each component of the result, with residuals.
// CHECK-LABEL: @transposed_tangent(
// CHECK: %[[T:.*]] = warp.load %arg2{{.*}} -> f32
// CHECK: %[[F:.*]]:2 = call @f(%[[V:[0-9]+]])
// CHECK: %[[G0:.*]] = call @g(%[[V]], %[[F]]#1, %{{.*}})
// CHECK: %[[D0:.*]] = warp.mul(%[[G0]], %[[T]])
// CHECK: %[[G1:.*]] = call @g(%[[V]], %[[F]]#1, %{{.*}})
// CHECK: %[[D1:.*]] = warp.mul(%[[G1]], %[[T]])
// CHECK: warp.construct(%[[D0]], %[[D1]])
// CHECK-NOT: call @g
func.func @transposed(%x: !warp.array<1 x f32>,
                      %y: !warp.array<1 x !warp.vec<2 x f32>>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %r:2 = func.call @f(%v) : (f32) -> (!warp.vec<2 x f32>, f32)
  warp.store %r#0, %y[%i] : !warp.vec<2 x f32>,
      !warp.array<1 x !warp.vec<2 x f32>>, si32
  return
}
func.func private @f(%x: f32) -> (!warp.vec<2 x f32>, f32)
    attributes {warp.vjp = @g, warp.residuals = 1 : i64, no_inline} {
  %v = warp.construct(%x, %x) : (f32, f32) -> !warp.vec<2 x f32>
  return %v, %x : !warp.vec<2 x f32>, f32
}
func.func private @g(%x: f32, %r: f32, %g: !warp.vec<2 x f32>) -> f32 {
  %i = warp.constant 1 : si32
  %c = warp.extract %g[%i] : !warp.vec<2 x f32>, si32 -> f32
  return %c : f32
}

// -----

// A pushforward gets the tangents, and the pullback is not asked.
// CHECK-LABEL: @pushed_tangent(
// CHECK: %[[T:.*]] = warp.load %arg2{{.*}} -> f32
// CHECK: call @f(%[[V:[0-9]+]])
// CHECK: %[[P:.*]] = call @p(%[[V]], %[[T]])
// CHECK-NOT: call @g
// CHECK: warp.store %[[P]]
func.func @pushed(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %r = func.call @f(%v) : (f32) -> f32
  warp.store %r, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}
func.func private @f(%x: f32) -> f32
    attributes {warp.vjp = @g, warp.jvp = @p, no_inline} {
  return %x : f32
}
func.func private @g(%x: f32, %g: f32) -> f32 {
  return %g : f32
}
func.func private @p(%x: f32, %t: f32) -> f32 {
  return %t : f32
}

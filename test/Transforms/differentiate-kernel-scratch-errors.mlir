// RUN: warp-opt %s --warp-differentiate-kernel=active=11 -verify-diagnostics

// Scratch memory has no gradient: one that would go through it is an error.
func.func @kept(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %c0 = arith.constant 0 : i32
  %i = warp.tid : si32
  %kept = warp.scratch : !warp.scratch<1 x f32>
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  warp.scratch_store %v, %kept[%c0] : f32, !warp.scratch<1 x f32>, i32
  // expected-error@+1 {{the adjoint of an adjoint does not go through values that a loop keeps: use 'wp.hessian' of the function}}
  %u = warp.scratch_load %kept[%c0] : !warp.scratch<1 x f32>, i32 -> f32
  warp.store %u, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

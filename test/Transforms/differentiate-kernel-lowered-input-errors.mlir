// RUN: warp-opt %s --split-input-file --verify-diagnostics --warp-differentiate-kernel

// Derivatives are made of what the front end builds; what later phases make of it
// is refused.

#cpu = #warp.variant<target = <name = "cpu", bits = 256>>

func.func @update(%x: !warp.array<1 x !warp.vec<2 x f32>>, %y: !warp.array<1 x !warp.vec<2 x f32>>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %c0 = arith.constant 0 : i32
  // expected-error @below {{expects a kernel of phase 'warp' to differentiate, which operation 'warp.load_components' is not part of}}
  %v:2 = warp.load_components %x[%c0] : !warp.array<1 x !warp.vec<2 x f32>>, i32 -> f32, f32
  warp.store_components(%v#0, %v#1), %y[%c0] : (f32, f32), !warp.array<1 x !warp.vec<2 x f32>>, i32
  return
}

// -----

func.func @index(%x: !warp.array<1 x f32>) attributes {warp.kernel} {
  // expected-error @below {{operation 'warp.tid' is not part of}}
  %i = warp.tid : i32
  return
}

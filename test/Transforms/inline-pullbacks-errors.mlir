// RUN: warp-opt %s -warp-inline-pullbacks=active=10 -verify-diagnostics

// An array that is chosen at run time has no gradient that is known.
func.func @chosen(%a: !warp.array<1 x f32>, %b: !warp.array<1 x f32>, %c: i1) attributes {warp.kernel} {
  %x = scf.if %c -> (!warp.array<1 x f32>) {
    scf.yield %a : !warp.array<1 x f32>
  } else {
    scf.yield %b : !warp.array<1 x f32>
  }
  call @pullback(%x) : (!warp.array<1 x f32>) -> ()
  return
}
func.func private @pullback(%x: !warp.array<1 x f32>) {
  %i = warp.tid : si32
  %one = warp.constant 1.0 : f32
  // expected-error @+1 {{cannot tell which array this gradient is of}}
  %g = warp.grad %x : !warp.array<1 x f32> -> !warp.array<1 x f32>
  warp.accumulate %one, %g[%i] : f32, !warp.array<1 x f32>, si32
  return
}

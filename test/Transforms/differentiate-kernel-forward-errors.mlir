// RUN: warp-opt %s --split-input-file --verify-diagnostics --warp-differentiate-kernel="mode=forward active=10"

// Which thread exchanges is not known, so neither is the tangent.
func.func @exchange(%x: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.constant 0 : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  // expected-error @+1 {{'atomic_cas' has no tangent, because its result depends on the order of threads}}
  %o = warp.atomic_cas %v, %v, %x[%i] : f32, f32, !warp.array<1 x f32>, si32
      -> f32
  return
}

// -----

// An operation that was not expanded is named by its Python name.
func.func @unexpanded(%x: !warp.array<1 x !warp.vec<3 x f32>>,
                      %y: !warp.array<1 x !warp.mat<3x3 x f32>>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x !warp.vec<3 x f32>>, si32
      -> !warp.vec<3 x f32>
  // expected-error @+1 {{'skew' has to be expanded before it is differentiated}}
  %m = warp.skew(%v) : (!warp.vec<3 x f32>) -> !warp.mat<3x3 x f32>
  warp.store %m, %y[%i] : !warp.mat<3x3 x f32>,
      !warp.array<1 x !warp.mat<3x3 x f32>>, si32
  return
}

// -----

// An array without tangents cannot take the place of one that has some.
func.func @arrays(%x: !warp.array<1 x f32>, %n: !warp.array<1 x f32>, %c: i1)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %a = scf.if %c -> !warp.array<1 x f32> {
    scf.yield %x : !warp.array<1 x f32>
  } else {
    %s = warp.constant 2 : si32
    %e = warp.slice %n[%i : %s : %s] dim 0
        : !warp.array<1 x f32>, si32, si32, si32
    // expected-error @+1 {{an array with tangents and one without them are exchanged here; give both arrays tangents}}
    scf.yield %e : !warp.array<1 x f32>
  }
  %v = warp.load %a[%i] : !warp.array<1 x f32>, si32 -> f32
  warp.store %v, %x[%i] : f32, !warp.array<1 x f32>, si32
  return
}

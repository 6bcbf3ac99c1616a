// RUN: warp-opt %s -verify-diagnostics -split-input-file

func.func @grad_c1(%a: !warp.array<1 x f16>) {
  // expected-error@+1 {{(C1) expects a result of type '!warp.array<1 x f32>', but got '!warp.array<1 x f16>'}}
  %0 = warp.grad %a : !warp.array<1 x f16> -> !warp.array<1 x f16>
  return
}

// -----

func.func @accumulate_c1(%a: !warp.array<2 x f32>, %i: si32, %v: f32) {
  // expected-error@+1 {{(C1) expects 2 indices for '!warp.array<2 x f32>', but got 1}}
  warp.accumulate %v, %a[%i] : f32, !warp.array<2 x f32>, si32
  return
}

// -----

func.func @accumulate_c2(%a: !warp.array<1 x f32>, %i: si32, %v: f64) {
  // expected-error@+1 {{(C2) elements of '!warp.array<1 x f32>' have type 'f32', but the value has type 'f64'}}
  warp.accumulate %v, %a[%i] : f64, !warp.array<1 x f32>, si32
  return
}

// -----

func.func @accumulate_c3(%a: !warp.array<1 x si32>, %i: si32) {
  // expected-error@+1 {{(C3) expects elements of floats, but got 'si32'}}
  warp.accumulate %i, %a[%i] : si32, !warp.array<1 x si32>, si32
  return
}

// -----

func.func @accumulate_c4(%a: !warp.array<1 x f32>, %i: si32, %v: f32) {
  // expected-error@+1 {{(C4) expects 'unique' to be 1 to 4, but got 5}}
  warp.accumulate %v, %a[%i] {unique = 5} : f32, !warp.array<1 x f32>, si32
  return
}

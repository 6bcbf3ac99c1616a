// RUN: warp-opt %s -split-input-file -verify-diagnostics

func.func @c1_function(%x: f32) {
  // expected-error @+1 {{(C1) expects a function, but got 'f'}}
  %0 = warp.vjp @f(%x) of (%x) : (f32), (f32) -> (f32)
  return
}

// -----

func.func private @f(f32) -> f32
func.func @c1_arguments(%x: f32, %n: si32) {
  // expected-error @+1 {{(C1) expects arguments of types ('f32'), but got ('si32')}}
  %0 = warp.jvp @f(%n) of (%x) : (si32), (f32) -> (f32)
  return
}

// -----

func.func private @f(f32) -> f32
func.func @c2_cotangents(%x: f32) {
  // expected-error @+1 {{(C2) expects cotangents of types ('f32'), but got ('f32', 'f32')}}
  %0 = warp.vjp @f(%x) of (%x, %x) : (f32), (f32, f32) -> (f32)
  return
}

// -----

func.func private @f(f32, si32, f64) -> f32
func.func @c2_tangents(%x: f32, %n: si32, %y: f64) {
  // expected-error @+1 {{(C2) expects tangents of types ('f32', 'f64'), but got ('f32', 'f32')}}
  %0 = warp.jvp @f(%x, %n, %y) of (%x, %x) : (f32, si32, f64), (f32, f32) -> (f32)
  return
}

// -----

func.func private @f(f32, si32) -> f32
func.func @c3_results(%x: f32, %n: si32) {
  // expected-error @+1 {{(C3) expects results of types ('f32'), but got ('f32', 'si32')}}
  %0:2 = warp.vjp @f(%x, %n) of (%x) : (f32, si32), (f32) -> (f32, si32)
  return
}

// RUN: warp-opt %s --split-input-file --verify-diagnostics

// A function has no more residuals than results.
// expected-error @+1 {{'warp.residuals' is from 0 to the number of results, 2, but is 3}}
func.func private @many(%x: f32) -> (f32, f32) attributes {warp.residuals = 3 : i64} {
  return %x, %x : f32, f32
}
func.func @calls(%x: f32) {
  %d = warp.vjp @many(%x) of (%x) : (f32), (f32) -> (f32)
  return
}

// -----

// Nor fewer than none.
// expected-error @+1 {{'warp.residuals' is from 0 to the number of results, 1, but is -1}}
func.func private @negative(%x: f32) -> f32 attributes {warp.residuals = -1 : i64} {
  return %x : f32
}

// -----

// expected-error @+1 {{'warp.residuals' is an integer of a 'func.func'}}
func.func private @text(%x: f32) -> f32 attributes {warp.residuals = "1"} {
  return %x : f32
}

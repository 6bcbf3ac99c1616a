// RUN: warp-opt %s --warp-resolve-derivatives --verify-diagnostics

// A derivative is made of functions that nothing outside of the module calls.
// expected-error @below {{expects a private function to differentiate, but 'square' is public}}
func.func @square(%x: f32) -> f32 {
  %y = warp.mul(%x, %x) : (f32, f32) -> f32
  return %y : f32
}

func.func @f(%x: f32, %dy: f32) -> f32 {
  %dx = warp.vjp @square(%x) of (%dy) : (f32), (f32) -> (f32)
  return %dx : f32
}

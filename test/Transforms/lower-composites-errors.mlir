// RUN: warp-opt %s --warp-lower-composites --split-input-file --verify-diagnostics

// A value that is not part of the front end's IR is reported at its place.
func.func @already_lowered(%a: !warp.array<1 x f32>, %n: si32) {
  %to = warp.cast %n : si32 to i32
  %zero = arith.constant 0 : i32
  %one = arith.constant 1 : i32
  scf.for %i = %zero to %to step %one : i32 {
    // expected-error@+1 {{'warp.load_components' op has no lowering to scalars}}
    %x = warp.load_components %a[%i] : !warp.array<1 x f32>, i32 -> f32
  }
  return
}

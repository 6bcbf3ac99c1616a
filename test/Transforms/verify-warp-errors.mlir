// RUN: warp-opt %s --verify-diagnostics --warp-verify-warp

// A straggler of the phase is named at its place.

func.func @k(%x: f32) attributes {warp.kernel} {
  // expected-error @below {{operation 'math.sin' is not part of phase 'warp'}}
  %0 = math.sin %x : f32
  return
}

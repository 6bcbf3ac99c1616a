// RUN: warp-opt %s --split-input-file --verify-diagnostics --warp-verify-thread

// A straggler of the phase is named at its place.

func.func @k(%x: f32) attributes {warp.kernel} {
  // expected-error @below {{operation 'warp.add' is not part of phase 'thread'}}
  %0 = warp.add(%x, %x) : (f32, f32) -> f32
  return
}

// -----

// expected-error @below {{type 'si32' is not part of phase 'thread'}}
func.func @k(%x: si32) attributes {warp.kernel} {
  return
}

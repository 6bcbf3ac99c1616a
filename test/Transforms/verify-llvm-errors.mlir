// RUN: warp-opt %s --verify-diagnostics --warp-verify-llvm

// A straggler of the phase is named at its place.

llvm.func @k(%x: f32) attributes {warp.entry} {
  // expected-error @below {{operation 'arith.addf' is not part of phase 'llvm'}}
  %0 = arith.addf %x, %x : f32
  llvm.return
}

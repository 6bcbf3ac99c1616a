// RUN: warp-opt %s --split-input-file --verify-diagnostics --warp-verify-gpu

// A straggler of the phase is named at its place.

gpu.module @k {
  gpu.func @k(%block: !llvm.ptr) kernel attributes {warp.entry} {
    // expected-error @below {{operation 'warp.parameter' is not part of phase 'gpu'}}
    %0 = warp.parameter %block[24] : !llvm.ptr -> f32
    gpu.return
  }
}

// -----

// expected-error @below {{expects the entry 'k' in a 'gpu.module'}}
llvm.func @k(%block: !llvm.ptr) attributes {warp.entry, warp.variant =
    #warp.variant<target = <name = "sm_90">>} {
  llvm.return
}

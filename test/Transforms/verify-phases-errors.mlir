// RUN: split-file %s %t
// RUN: warp-opt %t/warp.mlir --verify-diagnostics --warp-verify-warp
// RUN: warp-opt %t/thread-op.mlir --verify-diagnostics --warp-verify-thread
// RUN: warp-opt %t/thread-type.mlir --verify-diagnostics --warp-verify-thread
// RUN: warp-opt %t/gpu-op.mlir --verify-diagnostics --warp-verify-gpu
// RUN: warp-opt %t/gpu-entry.mlir --verify-diagnostics --warp-verify-gpu
// RUN: warp-opt %t/llvm.mlir --verify-diagnostics --warp-verify-llvm

// RUN: warp-opt %t/recursion.mlir --verify-diagnostics --warp-pipeline=to-warp

// A straggler of each phase is named at its place.

//--- warp.mlir
func.func @k(%x: f32) attributes {warp.kernel} {
  // expected-error @below {{operation 'math.sin' is not part of phase 'warp'}}
  %0 = math.sin %x : f32
  return
}

//--- recursion.mlir
func.func private @f(%x: f32) {
  // expected-error @below {{the call of 'f' cannot be inlined; functions cannot call themselves}}
  call @f(%x) : (f32) -> ()
  return
}
func.func @k(%x: f32) attributes {warp.kernel} {
  call @f(%x) : (f32) -> ()
  return
}

//--- thread-op.mlir
func.func @k(%x: f32) attributes {warp.kernel} {
  // expected-error @below {{operation 'warp.add' is not part of phase 'thread'}}
  %0 = warp.add(%x, %x) : (f32, f32) -> f32
  return
}

//--- thread-type.mlir
// expected-error @below {{type 'si32' is not part of phase 'thread'}}
func.func @k(%x: si32) attributes {warp.kernel} {
  return
}

//--- gpu-op.mlir
gpu.module @k {
  gpu.func @k(%block: !llvm.ptr) kernel attributes {warp.entry} {
    // expected-error @below {{operation 'warp.parameter' is not part of phase 'gpu'}}
    %0 = warp.parameter %block[24] : !llvm.ptr -> f32
    gpu.return
  }
}

//--- gpu-entry.mlir
// expected-error @below {{expects the entry 'k' in a 'gpu.module'}}
llvm.func @k(%block: !llvm.ptr) attributes {warp.entry, warp.variant =
    #warp.variant<target = <platform = cuda, version = 90>>} {
  llvm.return
}

//--- llvm.mlir
llvm.func @k(%x: f32) attributes {warp.entry} {
  // expected-error @below {{operation 'arith.addf' is not part of phase 'llvm'}}
  %0 = arith.addf %x, %x : f32
  llvm.return
}

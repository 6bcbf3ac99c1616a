// RUN: rm -rf %t && env WARP_DUMP=%t/stages warp-opt %s --warp-emit=asm > %t.s
// RUN: env WARP_DUMP=%t/stages warp-opt %s --warp-emit=asm --warp-options=target=sm_90 > %t.ptx
// RUN: FileCheck %s --check-prefix=WARP < %t/stages/k.cpu.1d.warp.mlir
// RUN: FileCheck %s --check-prefix=THREAD < %t/stages/k.cpu.1d.thread.mlir
// RUN: FileCheck %s --check-prefix=LAUNCH < %t/stages/k.cpu.1d.launch.mlir
// RUN: FileCheck %s --check-prefix=LLVM < %t/stages/k.cpu.1d.llvm.mlir
// RUN: FileCheck %s --check-prefix=IR < %t/stages/k.cpu.1d.ll
// RUN: diff %t.s %t/stages/k.cpu.1d.s
// RUN: diff %t.ptx %t/stages/k.sm_90.1d.ptx

// Every stage goes to its own file.
// WARP: warp.mul
// THREAD: arith.mulf
// LAUNCH: warp.threads
// LLVM: llvm.fmul
// IR: define void @k
func.func @k(%x: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %0 = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %1 = warp.mul(%0, %0) : (f32, f32) -> f32
  warp.store %1, %x[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm target=sm_90 packed=1 non-negative=2 large=true" | FileCheck %s

// A loop may take long in some threads: each of them has one item, however few
// bytes it moves.
// CHECK-LABEL: llvm.func {{.*}}@loop
// CHECK-NOT: #warp.schedule<coarsening
// CHECK: llvm.return
func.func @loop(%y: !warp.array<1 x f32>, %n: si32) attributes {warp.kernel} {
  %i = warp.tid : si32
  %x = warp.cast %i : si32 to f32
  %c0 = arith.constant 0 : index
  %c1 = arith.constant 1 : index
  %c100 = arith.constant 100 : index
  %r = scf.for %k = %c0 to %c100 step %c1 iter_args(%s = %x) -> f32 {
    %t = warp.sin(%s) : (f32) -> f32
    scf.yield %t : f32
  }
  warp.store %r, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// CHECK-LABEL: llvm.func {{.*}}@straight
// CHECK-SAME: #warp.schedule<coarsening
func.func @straight(%y: !warp.array<1 x f32>, %n: si32)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %x = warp.cast %i : si32 to f32
  %t = warp.sin(%x) : (f32) -> f32
  warp.store %t, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

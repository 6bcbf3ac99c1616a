// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm target=sm_90 packed=3 large=true" | FileCheck %s
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm target=sm_90 packed=3" | FileCheck %s --check-prefix=SMALL

// A large launch that moves 8 bytes per item has all loads of four items before
// the first store; the last block goes item by item.
// CHECK-LABEL: llvm.func @stream(
// CHECK-SAME: nvvm.kernel
// CHECK-SAME: #warp.schedule<coarsening = 4
// CHECK-COUNT-4: llvm.load {{.*}} : !llvm.ptr<1> -> f32
// CHECK-COUNT-4: llvm.store {{.*}} : f32, !llvm.ptr<1>
// CHECK: llvm.load {{.*}} : !llvm.ptr<1> -> f32
// CHECK: llvm.store {{.*}} : f32, !llvm.ptr<1>
// CHECK-NOT: llvm.store
// SMALL-LABEL: llvm.func @stream(
// SMALL-SAME: nvvm.kernel
// SMALL-NOT: #warp.schedule<coarsening
// SMALL-COUNT-1: llvm.store
// SMALL-NOT: llvm.store
// SMALL: llvm.return
func.func @stream(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %n = warp.neg(%v) : (f32) -> f32
  warp.store %n, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// A thread that moves 48 bytes keeps the card busy by itself.
// CHECK-LABEL: llvm.func @wide(
// CHECK-SAME: nvvm.kernel
// CHECK-NOT: #warp.schedule<coarsening
func.func @wide(%x: !warp.array<1 x !warp.vec<6 x f32>>,
                %y: !warp.array<1 x !warp.vec<6 x f32>>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x !warp.vec<6 x f32>>, si32
         -> !warp.vec<6 x f32>
  warp.store %v, %y[%i]
    : !warp.vec<6 x f32>, !warp.array<1 x !warp.vec<6 x f32>>, si32
  return
}

// -----

// Control flow may differ between items.
// CHECK-LABEL: llvm.func @branch(
// CHECK-SAME: nvvm.kernel
// CHECK-NOT: #warp.schedule<coarsening
func.func @branch(%x: !warp.array<1 x f32>, %c: i1)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  scf.if %c {
    %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
    %n = warp.neg(%v) : (f32) -> f32
    warp.store %n, %x[%i] : f32, !warp.array<1 x f32>, si32
  }
  return
}

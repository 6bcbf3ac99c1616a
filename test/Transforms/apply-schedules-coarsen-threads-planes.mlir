// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm target=sm_90 rank=2 packed=3 large=true" | FileCheck %s

// A body that ends in a guard takes neighbours of the first of two dimensions
// together where the guard holds for all, else one by one: two copies of the
// body, one with all loads before the first store.
// CHECK-LABEL: llvm.func @guarded(
// CHECK-SAME: nvvm.kernel
// CHECK-SAME: #warp.schedule<coarsening = 8
// CHECK-COUNT-8: llvm.load {{.*}} : !llvm.ptr<1> -> f32
// CHECK-COUNT-8: llvm.store {{.*}} : f32, !llvm.ptr<1>
// CHECK: llvm.load {{.*}} : !llvm.ptr<1> -> f32
// CHECK: llvm.store {{.*}} : f32, !llvm.ptr<1>
// CHECK-NOT: llvm.store
func.func @guarded(%x: !warp.array<2 x f32>, %y: !warp.array<2 x f32>)
    attributes {warp.kernel} {
  %i, %j = warp.tid : si32, si32
  %zero = warp.constant 0 : si32
  %one = warp.constant 1 : si32
  %edge = warp.eq(%i, %zero) : (si32, si32) -> i1
  scf.if %edge {
  } else {
    %before = warp.sub(%i, %one) : (si32, si32) -> si32
    %v = warp.load %x[%before, %j] : !warp.array<2 x f32>, si32, si32 -> f32
    warp.store %v, %y[%i, %j] : f32, !warp.array<2 x f32>, si32, si32
  }
  return
}

// -----

// A store before a guard would happen twice where guards differ.
// CHECK-LABEL: llvm.func @store_first(
// CHECK-SAME: nvvm.kernel
// CHECK-NOT: #warp.schedule<coarsening
func.func @store_first(%x: !warp.array<2 x f32>, %y: !warp.array<2 x f32>)
    attributes {warp.kernel} {
  %i, %j = warp.tid : si32, si32
  %zero = warp.constant 0 : si32
  %edge = warp.eq(%i, %zero) : (si32, si32) -> i1
  %v = warp.load %x[%i, %j] : !warp.array<2 x f32>, si32, si32 -> f32
  warp.store %v, %y[%i, %j] : f32, !warp.array<2 x f32>, si32, si32
  scf.if %edge {
    warp.store %v, %x[%i, %j] : f32, !warp.array<2 x f32>, si32, si32
  }
  return
}

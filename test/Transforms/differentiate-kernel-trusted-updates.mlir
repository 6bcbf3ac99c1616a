// RUN: warp-opt %s --warp-forward-stores --warp-differentiate-kernel=active=1111 --canonicalize --cse --warp-clean-up-adjoint | FileCheck %s

// Memory says which place of `best` a thread updates. The launch, which keeps
// what the counter returns, must be right whether threads conflict there or not.
// CHECK-LABEL: func @rows(
// CHECK-SAME: warp.augmented
// CHECK: %[[V:.*]] = warp.load %arg0
// CHECK: %[[ROW:.*]] = warp.atomic add %{{.*}}, %arg5
// CHECK: warp.store %[[ROW]], %arg6
// CHECK: %[[OLD:.*]] = warp.atomic max %[[V]], %arg1
// CHECK: warp.store %[[OLD]], %arg2

// The adjoint is right where they do not: then it is a load and a store.
// CHECK-LABEL: func @rows_adjoint(
// CHECK-NOT: warp.atomic

// A run before the recording claims the place with the thread's number, and
// computes nothing that is not needed for that.
// CHECK-LABEL: func @rows_size(
// CHECK-SAME: kind = claims
// CHECK: warp.atomic exch
// CHECK-NOT: warp.load

// The recording finds out whether threads conflict.
// CHECK-LABEL: func @rows_record(
// CHECK-SAME: kind = claims
// CHECK: warp.atomic exch
func.func @rows(%x: !warp.array<1 x f32>, %best: !warp.array<1 x f32>,
                %y: !warp.array<1 x f32>, %rows: !warp.array<1 x f32>,
                %cell: !warp.array<1 x si32>, %count: !warp.array<1 x si32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %zero = warp.constant 0 : si32
  %one = warp.constant 1 : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %row = warp.atomic add %one, %count[%zero] : si32, !warp.array<1 x si32>, si32 -> si32
  warp.store %v, %rows[%row] : f32, !warp.array<1 x f32>, si32
  %at = warp.load %cell[%i] : !warp.array<1 x si32>, si32 -> si32
  %old = warp.atomic max %v, %best[%at] : f32, !warp.array<1 x f32>, si32 -> f32
  warp.store %old, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// RUN: warp-opt %s --warp-forward-stores --split-input-file | FileCheck %s

// Each thread has an element of its own: what the update returns is what the
// element held.
// CHECK-LABEL: func @own
// CHECK-SAME: warp.max_rank = 1
func.func @own(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>,
               %slot: !warp.array<1 x f32>) attributes {warp.kernel} {
  // CHECK: %[[I:.*]] = warp.tid
  // CHECK: %[[V:.*]] = warp.load %arg0[%[[I]]]
  // CHECK: %[[OLD:.*]] = warp.load %arg2[%[[I]]]
  // CHECK: %[[NEW:.*]] = warp.min(%[[OLD]], %[[V]])
  // CHECK: warp.store %[[NEW]], %arg2[%[[I]]]
  // CHECK: warp.store %[[OLD]], %arg1[%[[I]]]
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %old = warp.atomic min %v, %slot[%i] : f32, !warp.array<1 x f32>, si32 -> f32
  warp.store %old, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// Threads that may meet keep their atomics, and so does an element whose old
// value nobody uses.
// CHECK-LABEL: func @shared
// CHECK-NOT: warp.max_rank
func.func @shared(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>,
                  %slot: !warp.array<1 x f32>) attributes {warp.kernel} {
  // CHECK: warp.atomic min
  // CHECK: warp.atomic add
  %i = warp.tid : si32
  %zero = warp.constant 0 : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %old = warp.atomic min %v, %slot[%zero] : f32, !warp.array<1 x f32>, si32 -> f32
  %sum = warp.atomic add %old, %y[%i] : f32, !warp.array<1 x f32>, si32 -> f32
  return
}

// -----

// A store may be to the same array, where another thread updates it.
// CHECK-LABEL: func @chosen
// CHECK: warp.atomic min
func.func @chosen(%x: !warp.array<1 x f32>, %slot: !warp.array<1 x f32>, %other: !warp.array<1 x f32>, %y: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %one = warp.constant 1 : si32
  %zero = warp.constant 0.0 : f32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %f = warp.gt(%v, %zero) : (f32, f32) -> i1
  %a = scf.if %f -> (!warp.array<1 x f32>) {
    scf.yield %slot : !warp.array<1 x f32>
  } else {
    scf.yield %other : !warp.array<1 x f32>
  }
  %j = warp.add(%i, %one) : (si32, si32) -> si32
  warp.store %v, %a[%j] : f32, !warp.array<1 x f32>, si32
  %old = warp.atomic min %v, %slot[%i] : f32, !warp.array<1 x f32>, si32 -> f32
  warp.store %old, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

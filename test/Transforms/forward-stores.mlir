// RUN: warp-opt %s --warp-forward-stores --split-input-file | FileCheck %s
// RUN: warp-opt %s --warp-forward-stores=unique=false --split-input-file | FileCheck %s --check-prefix=OVERLAP

// A value that a thread stored is not loaded; one that it loaded is not loaded
// again, after writes of other elements or arrays that are known to be apart.
// CHECK-LABEL: func.func @kernel
// OVERLAP-LABEL: func.func @kernel
func.func @kernel(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %f: i1)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %one = warp.constant 1 : si32
  %j = warp.add(%i, %one) : (si32, si32) -> si32
  // CHECK: %[[A:.*]] = warp.load %arg0
  %a = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  warp.store %a, %y[%i] : f32, !warp.array<1 x f32>, si32
  // CHECK-NOT: warp.load
  // OVERLAP: warp.load %arg0
  %b = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %c = warp.load %y[%i] : !warp.array<1 x f32>, si32 -> f32
  // CHECK: %[[S:.*]] = warp.add(%[[A]], %[[A]])
  %s = warp.add(%b, %c) : (f32, f32) -> f32
  // CHECK: warp.store %[[S]], %arg1
  warp.store %s, %y[%j] : f32, !warp.array<1 x f32>, si32
  %d = warp.load %y[%i] : !warp.array<1 x f32>, si32 -> f32
  // CHECK: warp.mul(%[[A]], %[[A]])
  %t = warp.mul(%d, %d) : (f32, f32) -> f32
  scf.if %f {
    // CHECK: scf.if
    // CHECK-NEXT: warp.store %[[A]], %arg0
    warp.store %d, %x[%j] : f32, !warp.array<1 x f32>, si32
    warp.store %t, %y[%i] : f32, !warp.array<1 x f32>, si32
  }
  // A branch may have written this one.
  // CHECK: warp.load %arg1
  %e = warp.load %y[%i] : !warp.array<1 x f32>, si32 -> f32
  warp.store %e, %x[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// An element that a loop updates is a value that the loop carries, read before
// the loop if that runs at all. Only stores are left in it.
// CHECK-LABEL: func.func @update
// CHECK: %[[RUNS:.*]] = arith.cmpi slt
// CHECK: %[[FIRST:.*]] = scf.if %[[RUNS]] -> (f32) {
// CHECK-NEXT: warp.load
// CHECK: scf.for {{.*}} iter_args(%[[OLD:.*]] = %[[FIRST]]) -> (f32)
// CHECK-NOT: warp.load
// CHECK: %[[NEW:.*]] = warp.mul(%[[OLD]], %[[OLD]])
// CHECK: warp.store %[[NEW]]
// CHECK: %[[OR:.*]] = scf.if %{{.*}} -> (f32) {
// CHECK: warp.store %[[OLD]]
// CHECK-NEXT: scf.yield %[[OLD]]
// CHECK: } else {
// CHECK-NEXT: scf.yield %[[NEW]]
// CHECK: scf.yield %[[OR]]
// OVERLAP-LABEL: func.func @update
// OVERLAP-NOT: iter_args
func.func @update(%y: !warp.array<1 x f32>, %n: i32, %f: i1)
    attributes {warp.kernel} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : si32
  scf.for %k = %c0 to %n step %c1 : i32 {
    %a = warp.load %y[%i] : !warp.array<1 x f32>, si32 -> f32
    %b = warp.mul(%a, %a) : (f32, f32) -> f32
    warp.store %b, %y[%i] : f32, !warp.array<1 x f32>, si32
    scf.if %f {
      warp.store %a, %y[%i] : f32, !warp.array<1 x f32>, si32
    }
  }
  return
}

// RUN: warp-opt %s --split-input-file --warp-differentiate-kernel=active=11 --canonicalize --cse --warp-simplify-adjoint --canonicalize --cse | FileCheck %s

// A sum needs none of its partial sums: the reverse loop is all there is, every
// iteration has the same cotangent, and since their order does not matter they
// run forward.
// CHECK-LABEL: func.func @sum_adjoint
// CHECK-NOT: scf.
// CHECK: %[[G:.*]] = warp.load
// CHECK: scf.for unsigned %[[K:.*]] = %c0_i32 to
// CHECK-NOT: iter_args
// CHECK: warp.accumulate %[[G]], %{{.*}}[%[[K]]]
// CHECK-NOT: scf.
// CHECK: return
func.func @sum(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel} {
  %zero = warp.constant 0.0 : f32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : si32
  %s = scf.for %k = %c0 to %n step %c1 iter_args(%t = %zero) -> f32 : i32 {
    %v = warp.load %x[%k] : !warp.array<1 x f32>, i32 -> f32
    %u = warp.add(%t, %v) : (f32, f32) -> f32
    scf.yield %u : f32
  }
  warp.store %s, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// Integers that go up by a step have a formula of the number of the iteration:
// still no replay.
// CHECK-LABEL: func.func @stepped_adjoint
// CHECK-NOT: scf.while
// CHECK-NOT: warp.scratch
// CHECK: scf.for unsigned %[[NUMBER:.*]] = %c0_i32 to
// CHECK: %[[COUNT:.*]] = warp.cast %[[NUMBER]] : i32 to si32
// CHECK: %[[MOVED:.*]] = warp.mul(%[[COUNT]], %{{.*}})
// CHECK: %[[AT:.*]] = warp.add(%{{.*}}, %[[MOVED]])
// CHECK: warp.accumulate %{{.*}}, %{{.*}}[%[[AT]]]
func.func @stepped(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: i32,
                   %first: si32) attributes {warp.kernel} {
  %zero = warp.constant 0.0 : f32
  %three = warp.constant 3 : si32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : si32
  %s:2 = scf.for %k = %c0 to %n step %c1
      iter_args(%t = %zero, %at = %first) -> (f32, si32) : i32 {
    %v = warp.load %x[%at] : !warp.array<1 x f32>, si32 -> f32
    %u = warp.add(%t, %v) : (f32, f32) -> f32
    %next = warp.add(%at, %three) : (si32, si32) -> si32
    scf.yield %u, %next : f32, si32
  }
  warp.store %s#0, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// A product needs its partial products. Any number of trips: they come from a
// ring and a stack of checkpoints; one loop goes forward, one back.
// CHECK-LABEL: func.func @product_adjoint
// CHECK-DAG: %[[RING:.*]] = warp.scratch : !warp.scratch<32 x f32>
// CHECK-DAG: %[[STATES:.*]] = warp.scratch : !warp.scratch<49 x f32>
// CHECK-DAG: %[[STARTS:.*]] = warp.scratch : !warp.scratch<49 x i32>
// CHECK: scf.while
// CHECK: do
// CHECK: warp.scratch_load %[[STARTS]]
// CHECK: %[[STATE:.*]] = warp.scratch_load %[[STATES]]
// CHECK: %[[REACHED:.*]] = scf.for unsigned {{.*}} iter_args(%[[P:.*]] = %[[STATE]])
// CHECK: warp.scratch_store %[[P]], %[[RING]]
// CHECK: warp.mul(%[[P]],
// CHECK: warp.scratch_store %[[REACHED]], %[[STATES]]
// CHECK: scf.for unsigned {{.*}} iter_args(%[[G:.*]] = %
// CHECK: %[[BEFORE:.*]] = warp.scratch_load %[[RING]]
// CHECK: warp.mul(%[[G]],
// CHECK: warp.mul(%[[BEFORE]], %[[G]])
// CHECK: warp.accumulate
// CHECK-NOT: scf.for
func.func @product(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel} {
  %one = warp.constant 1.0 : f32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : si32
  %s = scf.for %k = %c0 to %n step %c1 iter_args(%t = %one) -> f32 : i32 {
    %v = warp.load %x[%k] : !warp.array<1 x f32>, i32 -> f32
    %u = warp.mul(%t, %v) : (f32, f32) -> f32
    scf.yield %u : f32
  }
  warp.store %s, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// 64 floats fit: all are kept, and none is computed twice.
// CHECK-LABEL: func.func @short_adjoint
// CHECK-NOT: scf.while
// CHECK: %[[TAPE:.*]] = warp.scratch : !warp.scratch<64 x f32>
// CHECK: scf.for
// CHECK: warp.scratch_store %{{.*}}, %[[TAPE]]
// CHECK: scf.for
// CHECK: %[[NUMBER:.*]] = arith.subi %{{.*}}, %{{.*}} {warp.non_negative}
// CHECK: warp.scratch_load %[[TAPE]][%[[NUMBER]]]
func.func @short(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %c64 = arith.constant 64 : i32
  %i = warp.tid : si32
  %first = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %s = scf.for %k = %c0 to %c64 step %c1 iter_args(%t = %first) -> f32 : i32 {
    %u = warp.sin(%t) : (f32) -> f32
    scf.yield %u : f32
  }
  warp.store %s, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// A loop that no gradient comes from leaves nothing behind.
// CHECK-LABEL: func.func @unused_adjoint
// CHECK-NOT: scf.
// CHECK: return
func.func @unused(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel} {
  %one = warp.constant 1.0 : f32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : si32
  %s = scf.for %k = %c0 to %n step %c1 iter_args(%t = %one) -> f32 : i32 {
    %v = warp.load %x[%k] : !warp.array<1 x f32>, i32 -> f32
    %u = warp.mul(%t, %v) : (f32, f32) -> f32
    scf.yield %u : f32
  }
  warp.store %one, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

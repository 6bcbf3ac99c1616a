// RUN: warp-opt %s --warp-forward-stores --warp-differentiate-kernel=active=11 --canonicalize --cse --warp-clean-up-adjoint --split-input-file | FileCheck %s

// A value that a thread overwrites is read where it was kept before the launch.
// CHECK-LABEL: func.func @in_place_adjoint
// CHECK-SAME: %[[A:.*]]: !warp.array<1 x f32>, %[[B:.*]]: !warp.array<1 x f32>, %[[OLD:.*]]: !warp.array<1 x f32>)
// CHECK-SAME: warp.arg_names = ["a", "b", "preserved.0"]
// CHECK-SAME: warp.hidden = [#warp.hidden<kind = preserved, leaf = 0>
// CHECK-SAME: warp.needed = [1]
// CHECK-DAG: warp.load %[[OLD]]
// CHECK-DAG: warp.load %[[B]]
// CHECK: warp.accumulate
func.func @in_place(%a: !warp.array<1 x f32>, %b: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.arg_names = ["a", "b"]} {
  %i = warp.tid : si32
  %x = warp.load %a[%i] : !warp.array<1 x f32>, si32 -> f32
  %y = warp.load %b[%i] : !warp.array<1 x f32>, si32 -> f32
  %p = warp.mul(%x, %y) : (f32, f32) -> f32
  warp.store %p, %a[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// A sum leaves the gradient of the element where it is; nothing is needed.
// CHECK-LABEL: func.func @subtract_adjoint
// CHECK-NOT: warp.hidden
// CHECK-SAME: warp.needed = []
// CHECK: %[[G:.*]] = warp.load
// CHECK-NOT: warp.store
// CHECK: %[[N:.*]] = warp.neg(%[[G]])
// CHECK: warp.accumulate %[[N]]
func.func @subtract(%a: !warp.array<1 x f32>, %b: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %y = warp.load %b[%i] : !warp.array<1 x f32>, si32 -> f32
  %old = warp.atomic sub %y, %a[%i] : f32, !warp.array<1 x f32>, si32 -> f32
  return
}

// -----

// Threads may meet where indices are read from an array.
// CHECK-LABEL: func.func @gather_adjoint
// CHECK-SAME: atomics = 1
// CHECK-SAME: warp.needed = [2]
// CHECK-NOT: unique
func.func @gather(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>,
                  %p: !warp.array<1 x si32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %j = warp.load %p[%i] : !warp.array<1 x si32>, si32 -> si32
  %v = warp.load %x[%j] : !warp.array<1 x f32>, si32 -> f32
  warp.store %v, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// Two of two dimensions tell threads apart; elements 2 i and 2 i + 1 belong to
// one thread.
// CHECK-LABEL: func.func @owned_adjoint
// CHECK: warp.accumulate {{.*}} {unique = 1 : i64} : f32, !warp.array<1 x f32>
// CHECK: warp.accumulate {{.*}} {unique = 1 : i64} : f32, !warp.array<1 x f32>
func.func @owned(%x: !warp.array<1 x f32>, %y: !warp.array<2 x f32>)
    attributes {warp.kernel} {
  %i, %j = warp.tid : si32, si32
  %two = warp.constant 2 : si32
  %one = warp.constant 1 : si32
  %k = warp.mul(%i, %two) : (si32, si32) -> si32
  %l = warp.add(%k, %one) : (si32, si32) -> si32
  %v = warp.load %x[%k] : !warp.array<1 x f32>, si32 -> f32
  %w = warp.load %x[%l] : !warp.array<1 x f32>, si32 -> f32
  %p = warp.add(%v, %w) : (f32, f32) -> f32
  warp.store %p, %y[%i, %j] : f32, !warp.array<2 x f32>, si32, si32
  return
}

// -----

// Neighbours of a stencil belong to several threads.
// CHECK-LABEL: func.func @stencil_adjoint
// CHECK: warp.accumulate
// CHECK-NOT: unique
func.func @stencil(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %one = warp.constant 1 : si32
  %j = warp.add(%i, %one) : (si32, si32) -> si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %w = warp.load %x[%j] : !warp.array<1 x f32>, si32 -> f32
  %p = warp.add(%v, %w) : (f32, f32) -> f32
  warp.store %p, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// The order of threads gave the index: the kernel keeps it for the adjoint, in
// an argument of both.
// CHECK-LABEL: func.func @claim(
// CHECK-SAME: %[[SAVE:[a-z0-9]*]]: !warp.array<4 x si32>)
// CHECK-SAME: warp.augmented
// CHECK: %[[J:.*]] = warp.atomic add
// CHECK: warp.store %[[J]], %[[SAVE]]
// CHECK-LABEL: func.func @claim_adjoint
// CHECK-SAME: %[[SAVED:[a-z0-9]*]]: !warp.array<4 x si32>)
// CHECK-SAME: warp.hidden = [#warp.hidden<kind = saved
// CHECK: warp.load %[[SAVED]]
func.func @claim(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>,
                 %n: !warp.array<1 x si32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %zero = warp.constant 0 : si32
  %one = warp.constant 1 : si32
  %j = warp.atomic add %one, %n[%zero] : si32, !warp.array<1 x si32>,
      si32 -> si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  warp.store %v, %y[%j] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// The thread whose value is the smallest one takes the gradient; where NaN is
// left, a thread with NaN.
// CHECK-LABEL: func.func @smallest_adjoint
// CHECK: %[[LEFT:.*]] = warp.load %arg1
// CHECK: %[[SAME:.*]] = warp.eq(%[[LEFT]], %[[VALUE:.*]]) :
// CHECK: %[[FROM:.*]] = warp.isnan(%[[VALUE]])
// CHECK: %[[TO:.*]] = warp.isnan(%[[LEFT]])
// CHECK: %[[WINS:.*]] = warp.where(%[[FROM]], %[[TO]], %[[SAME]])
// CHECK: scf.if %[[WINS]]
// CHECK: warp.atomic exch
// CHECK: warp.accumulate
func.func @smallest(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %zero = warp.constant 0 : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %old = warp.atomic min %v, %y[%zero] : f32, !warp.array<1 x f32>, si32 -> f32
  return
}

// -----

// Threads of a CPU whose number a minimum of shared elements does not leave have
// nothing to reverse, not even the loop before it.
// CHECK-LABEL: func.func @least_row_adjoint
// CHECK: scf.for
// CHECK: warp.library_call "warp_is_cpu"
// CHECK: %[[ENTERS:.*]] = arith.ori
// CHECK: scf.if %[[ENTERS]]
// CHECK: warp.atomic exch
// CHECK: scf.for
// CHECK: warp.accumulate
// CHECK-NOT: warp.accumulate
func.func @least_row(%x: !warp.array<2 x f32>, %y: !warp.array<1 x f32>,
                     %t: !warp.array<1 x si32>, %n: i32)
    attributes {warp.kernel} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %none = warp.constant 0.0 : f32
  %i = warp.tid : si32
  %s = scf.for %c = %c0 to %n step %c1 iter_args(%sum = %none) -> (f32) : i32 {
    %k = warp.cast %c : i32 to si32
    %v = warp.load %x[%i, %k] : !warp.array<2 x f32>, si32, si32 -> f32
    %q = warp.mul(%v, %v) : (f32, f32) -> f32
    %r = warp.add(%sum, %q) : (f32, f32) -> f32
    scf.yield %r : f32
  }
  %at = warp.load %t[%i] : !warp.array<1 x si32>, si32 -> si32
  %old = warp.atomic min %s, %y[%at] : f32, !warp.array<1 x f32>, si32 -> f32
  return
}

// -----

// One thread: a chain through memory reads what is there still.
// CHECK-LABEL: func.func @chain_adjoint
// CHECK-NOT: warp.hidden
// CHECK-SAME: warp.one_thread
func.func @chain(%x: !warp.array<1 x f32>, %p: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %one = warp.constant 1 : si32
  scf.for %c = %c0 to %n step %c1 : i32 {
    %k = warp.cast %c : i32 to si32
    %l = warp.add(%k, %one) : (si32, si32) -> si32
    %a = warp.load %x[%k] : !warp.array<1 x f32>, si32 -> f32
    %b = warp.load %p[%k] : !warp.array<1 x f32>, si32 -> f32
    %q = warp.mul(%a, %b) : (f32, f32) -> f32
    warp.store %q, %p[%l] : f32, !warp.array<1 x f32>, si32
  }
  return
}

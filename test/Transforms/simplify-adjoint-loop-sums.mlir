// RUN: warp-opt %s --split-input-file --warp-simplify-adjoint --canonicalize | FileCheck %s

// The same element in every iteration: the loop carries the sum, and adds it
// if there was an iteration.
// CHECK-LABEL: func.func @moved
// CHECK-SAME: %[[X:[^:]*]]: !warp.array<1 x f32>, %[[V:[^:]*]]: f32, %[[I:[^:]*]]: si32, %[[N:[^:]*]]: i32)
// CHECK: %[[G:.*]] = warp.grad %[[X]]
// CHECK: %[[S:.*]] = scf.for {{.*}} iter_args(%[[T:.*]] = %{{.*}}) -> (f32)
// CHECK-NOT: warp.accumulate
// CHECK: %[[U:.*]] = warp.add(%[[T]], %[[V]])
// CHECK: scf.yield %[[U]]
// CHECK: %[[ANY:.*]] = arith.cmpi sgt, %[[N]]
// CHECK: scf.if %[[ANY]] {
// CHECK-NEXT: warp.accumulate %[[S]], %[[G]][%[[I]]] {unique = 1 : i64}
func.func @moved(%x: !warp.array<1 x f32>, %v: f32, %i: si32, %n: i32)
    attributes {warp.kernel} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %g = warp.grad %x : !warp.array<1 x f32> -> !warp.array<1 x f32>
  scf.for %k = %c0 to %n step %c1 : i32 {
    warp.accumulate %v, %g[%i] {unique = 1} : f32, !warp.array<1 x f32>, si32
  }
  return
}

// -----

// Out of two loops, and from under a condition.
// CHECK-LABEL: func.func @nested
// CHECK: %{{.*}}:2 = scf.for {{.*}} iter_args(%{{.*}} = %{{.*}}, %{{.*}} = %false)
// CHECK: scf.for
// CHECK-NOT: warp.accumulate
// CHECK: arith.ori
// CHECK: scf.yield
// CHECK: }
// CHECK: scf.if
// CHECK: warp.accumulate
func.func @nested(%x: !warp.array<1 x f32>, %v: f32, %i: si32, %n: i32,
                  %c: i1) attributes {warp.kernel} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %g = warp.grad %x : !warp.array<1 x f32> -> !warp.array<1 x f32>
  scf.for %k = %c0 to %n step %c1 : i32 {
    scf.for %l = %c0 to %k step %c1 : i32 {
      scf.if %c {
        warp.accumulate %v, %g[%i] : f32, !warp.array<1 x f32>, si32
      }
    }
  }
  return
}

// -----

// A gradient that the loop also reads stays where it is.
// CHECK-LABEL: func.func @taken
// CHECK: scf.for
// CHECK: warp.load
// CHECK: warp.accumulate
// CHECK: }
// CHECK-NEXT: return
func.func @taken(%x: !warp.array<1 x f32>, %v: f32, %i: si32, %n: i32)
    attributes {warp.kernel} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %g = warp.grad %x : !warp.array<1 x f32> -> !warp.array<1 x f32>
  scf.for %k = %c0 to %n step %c1 : i32 {
    %h = warp.load %g[%k] : !warp.array<1 x f32>, i32 -> f32
    warp.store %v, %g[%k] : f32, !warp.array<1 x f32>, i32
    warp.accumulate %h, %g[%i] : f32, !warp.array<1 x f32>, si32
  }
  return
}

// -----

// Carried values that only lead to their own next value go, with the branch
// results and loops that make them.
// CHECK-LABEL: func.func @circle
// CHECK: %[[S:.*]] = scf.for {{.*}} iter_args(%{{.*}} = %{{.*}}) -> (f32)
// CHECK-NOT: warp.mul
// CHECK-NOT: scf.if
// CHECK: warp.store %[[S]]
func.func @circle(%x: !warp.array<1 x f32>, %v: f32, %i: si32, %n: i32,
                  %c: i1) attributes {warp.kernel} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %s:2 = scf.for %k = %c0 to %n step %c1 iter_args(%a = %v, %b = %v)
      -> (f32, f32) : i32 {
    %t = warp.add(%a, %v) : (f32, f32) -> f32
    %u = scf.if %c -> f32 {
      %w = warp.mul(%b, %v) : (f32, f32) -> f32
      scf.yield %w : f32
    } else {
      scf.yield %b : f32
    }
    scf.yield %t, %u : f32, f32
  }
  warp.store %s#0, %x[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// A sum in branches in one another, in either arm, moves out as well; the loop
// carries whether an iteration came to it.
// CHECK-LABEL: func.func @nested
// CHECK-NOT: warp.accumulate
// CHECK: %[[S:.*]]:2 = scf.for {{.*}} -> (f32, i1)
// CHECK-NOT: warp.accumulate
// CHECK: scf.if %[[S]]#1 {
// CHECK-NEXT: warp.accumulate %[[S]]#0
func.func @nested(%x: !warp.array<1 x f32>, %v: f32, %i: si32, %n: i32, %m: i32)
    attributes {warp.kernel} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %g = warp.grad %x : !warp.array<1 x f32> -> !warp.array<1 x f32>
  scf.for %k = %c0 to %n step %c1 : i32 {
    %made = arith.cmpi ult, %k, %m : i32
    scf.if %made {
      %h = warp.load %x[%k] : !warp.array<1 x f32>, i32 -> f32
      %last = warp.gt(%h, %v) : (f32, f32) -> i1
      scf.if %last {
      } else {
        %w = warp.mul(%h, %v) : (f32, f32) -> f32
        warp.accumulate %w, %g[%i] : f32, !warp.array<1 x f32>, si32
      }
    }
  }
  return
}

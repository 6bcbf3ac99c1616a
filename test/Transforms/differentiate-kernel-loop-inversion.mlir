// RUN: warp-opt %s --split-input-file --warp-differentiate-kernel='active=11 dump-recovery' -verify-diagnostics --canonicalize --cse --warp-simplify-adjoint --canonicalize --cse | FileCheck %s

// Iterations that only add have no order: their loop runs forward and carries a
// random state along, without memory and without a second loop.
// CHECK-LABEL: func.func @along_adjoint
// CHECK-NOT: warp.scratch
// CHECK: scf.for {{.*}} iter_args(%[[STATE:.*]] = %arg3)
// CHECK: %[[DRAW:.*]]:2 = warp.randf(%[[STATE]])
// CHECK: warp.accumulate
// CHECK: scf.yield %[[DRAW]]#1
// CHECK-NOT: scf.for
func.func @along(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: i32,
                 %seed: ui32) attributes {warp.kernel} {
  %zero = warp.constant 0.0 : f32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : si32
  // expected-remark@+1 {{carried value 1 of type 'ui32': rank 3, 0 bytes}}
  %s:2 = scf.for %k = %c0 to %n step %c1
      iter_args(%t = %zero, %state = %seed) -> (f32, ui32) : i32 {
    %u:2 = warp.randf(%state) : (ui32) -> (f32, ui32)
    %v = warp.load %x[%k] : !warp.array<1 x f32>, i32 -> f32
    %w = warp.mul(%v, %u#0) : (f32, f32) -> f32
    %next = warp.add(%t, %w) : (f32, f32) -> f32
    scf.yield %next, %u#1 : f32, ui32
  }
  warp.store %s#0, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// Otherwise the state is carried backwards from where a forward run of it alone
// ends: multiplied by the inverse of 1664525 modulo 2^32.
// CHECK-LABEL: func.func @generator_adjoint
// CHECK-DAG: %[[INVERSE:.*]] = warp.constant 4276115653 : ui32
// CHECK-DAG: %[[FACTOR:.*]] = warp.constant 1664525 : ui32
// CHECK-NOT: warp.scratch
// CHECK: %[[LAST:.*]] = scf.for
// CHECK: warp.mul(%{{.*}}, %[[FACTOR]])
// CHECK: scf.for {{.*}} iter_args({{.*}}, %[[AFTER:.*]] = %[[LAST]])
// CHECK: %[[LESS:.*]] = warp.sub(%[[AFTER]], %{{.*}})
// CHECK: %[[BEFORE:.*]] = warp.mul(%[[LESS]], %[[INVERSE]])
// CHECK: scf.yield %{{.*}}, %[[BEFORE]]
func.func @generator(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>,
                     %n: i32, %seed: ui32) attributes {warp.kernel} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %factor = warp.constant 1664525 : ui32
  %term = warp.constant 1013904223 : ui32
  %i = warp.tid : si32
  %one = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  // expected-remark@+1 {{carried value 1 of type 'ui32': rank 4, 0 bytes}}
  %s:2 = scf.for %k = %c0 to %n step %c1
      iter_args(%t = %one, %state = %seed) -> (f32, ui32) : i32 {
    %f = warp.cast %state : ui32 to f32
    %u = warp.mul(%t, %f) : (f32, f32) -> f32
    %m = warp.mul(%state, %factor) : (ui32, ui32) -> ui32
    %next = warp.add(%m, %term) : (ui32, ui32) -> ui32
    scf.yield %u, %next : f32, ui32
  }
  warp.store %s#0, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// An even factor loses a bit, and so do two values that become one.
// CHECK-LABEL: func.func @lossy_adjoint
// CHECK: warp.scratch
func.func @lossy(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>,
                 %n: i32, %seed: ui32) attributes {warp.kernel} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %six = warp.constant 6 : ui32
  %i = warp.tid : si32
  %one = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  // expected-remark@+2 {{carried value 1 of type 'ui32': rank 6}}
  // expected-remark@+1 {{carried value 2 of type 'ui32': rank 6}}
  %s:3 = scf.for %k = %c0 to %n step %c1
      iter_args(%t = %one, %a = %seed, %b = %seed) -> (f32, ui32, ui32) : i32 {
    %f = warp.cast %a : ui32 to f32
    %g = warp.cast %b : ui32 to f32
    %u = warp.mul(%t, %f) : (f32, f32) -> f32
    %v = warp.mul(%u, %g) : (f32, f32) -> f32
    %next = warp.mul(%a, %six) : (ui32, ui32) -> ui32
    %sum = warp.add(%a, %b) : (ui32, ui32) -> ui32
    scf.yield %v, %next, %sum : f32, ui32, ui32
  }
  warp.store %s#0, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// Values that depend on each other are solved for one after the other: the
// second after is the first before.
// CHECK-LABEL: func.func @exchanged_adjoint
// CHECK-NOT: warp.scratch
// CHECK: scf.for {{.*}} iter_args({{.*}}, %[[A:.*]] = %{{.*}}, %[[B:.*]] = %{{.*}})
// CHECK: %[[FIRST:.*]] = warp.sub(%[[A]], %[[B]])
// CHECK: scf.yield %{{.*}}, %[[B]], %[[FIRST]]
func.func @exchanged(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>,
                     %n: i32) attributes {warp.kernel} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : si32
  %one = warp.constant 1 : si32
  %start = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  // expected-remark@+1 {{carried value 2 of type 'si32': rank 4, 0 bytes}}
  %s:3 = scf.for %k = %c0 to %n step %c1
      iter_args(%t = %start, %a = %i, %b = %one) -> (f32, si32, si32) : i32 {
    %f = warp.cast %b : si32 to f32
    %u = warp.mul(%t, %f) : (f32, f32) -> f32
    %sum = warp.add(%a, %b) : (si32, si32) -> si32
    scf.yield %u, %sum, %a : f32, si32, si32
  }
  warp.store %s#0, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

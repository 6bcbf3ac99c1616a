// RUN: warp-opt %s --split-input-file --warp-differentiate-kernel='active=11 tape=global' --canonicalize --cse --warp-simplify-adjoint --canonicalize --cse --warp-clean-up-adjoint | FileCheck %s
// RUN: warp-opt %s --split-input-file --warp-differentiate-kernel='active=11 tape=global dump-recovery' -verify-diagnostics -o /dev/null

// The adjoint keeps all iterations from the offset of the thread on.
// CHECK-LABEL: func.func @sines_adjoint
// CHECK-SAME: %[[N:.*]]: i32, %[[TRIPS:.*]]: !warp.array<4 x si64>, %[[OFFSETS:.*]]: !warp.array<4 x si64>, %[[TAPE:.*]]: !warp.array<2 x f32>)
// CHECK-SAME: tape_bytes = 0
// CHECK-SAME: tape_bytes_per_trip = 4
// CHECK: %[[ROOM:.*]] = warp.load %[[TRIPS]]
// CHECK-NOT: warp.max
// CHECK: warp.min(%[[ROOM]]
// CHECK: warp.load %[[OFFSETS]]
// CHECK: scf.for
// CHECK: warp.store %{{.*}}, %[[TAPE]]
// CHECK: warp.sin
// CHECK: scf.for
// CHECK: warp.load %[[TAPE]]
// CHECK: warp.cos
// CHECK: return

// How many there are is counted before, for this loop by its bound alone.
// CHECK-LABEL: func.func @sines_adjoint_count
// CHECK-SAME: %[[N:.*]]: i32, %[[TRIPS:.*]]: !warp.array<4 x si64>)
// CHECK-SAME: warp.counting
// CHECK-NOT: scf.for
// CHECK-NOT: warp.sin
// CHECK: %[[MOST:.*]] = warp.max
// CHECK: warp.store %[[MOST]], %[[TRIPS]]
// CHECK: return
func.func @sines(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : si32
  %start = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  // expected-remark@+1 {{carried value 0 of type 'f32': rank 7, 4 bytes per trip}}
  %s = scf.for %k = %c0 to %n step %c1 iter_args(%t = %start) -> f32 : i32 {
    %u = warp.sin(%t) : (f32) -> f32
    scf.yield %u : f32
  }
  warp.store %s, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// A loop with a condition runs forward to be counted, but it is not reversed.
// CHECK-LABEL: func.func @halves_adjoint
// CHECK-LABEL: func.func @halves_adjoint_count
// CHECK: scf.while
// CHECK-NOT: warp.accumulate
// CHECK-NOT: warp.cos
// CHECK: warp.store
// CHECK: return
func.func @halves(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %low = warp.constant 0.01 : f32
  %i = warp.tid : si32
  %start = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  // expected-remark@+1 {{carried value 0 of type 'f32': rank 7, 4 bytes per trip}}
  %s = scf.while (%t = %start) : (f32) -> f32 {
    %more = warp.gt(%t, %low) : (f32, f32) -> i1
    scf.condition(%more) %t : f32
  } do {
  ^bb0(%t: f32):
    %u = warp.sin(%t) : (f32) -> f32
    %v = warp.mul(%u, %t) : (f32, f32) -> f32
    scf.yield %v : f32
  }
  warp.store %s, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// A loop in another one that needs its values from memory has checkpoints.
// CHECK-LABEL: func.func @nested_adjoint
// CHECK-SAME: tape_bytes_per_trip = 4
// CHECK: warp.scratch
// CHECK: return
func.func @nested(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : si32
  %start = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  // expected-remark@+1 {{carried value 0 of type 'f32': rank 7, 4 bytes per trip}}
  %s = scf.for %k = %c0 to %n step %c1 iter_args(%t = %start) -> f32 : i32 {
    // expected-remark@+1 {{carried value 0 of type 'f32': rank 6, 324 bytes}}
    %r = scf.for %j = %c0 to %n step %c1 iter_args(%u = %t) -> f32 : i32 {
      %v = warp.sin(%u) : (f32) -> f32
      scf.yield %v : f32
    }
    scf.yield %r : f32
  }
  warp.store %s, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

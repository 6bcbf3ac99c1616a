// RUN: warp-opt %s --split-input-file --warp-differentiate-kernel=active=11 --canonicalize --cse --warp-simplify-adjoint --canonicalize --cse | FileCheck %s

// A loop that is left early carries a counter and a flag. Its reverse adds only,
// so it is a loop with the same condition, and the sum that decides comes along:
// nobody has to count trips before.
// CHECK-LABEL: func.func @left_adjoint
// CHECK-NOT: warp.scratch
// CHECK: scf.while (%{{.*}}, %[[DONE:.*]] = %{{.*}}, %{{.*}})
// CHECK: warp.unot(%[[DONE]])
// CHECK: } do {
// CHECK: ^bb0(%{{.*}}: ui32, %{{.*}}: i1, %[[SUM:.*]]: f32):
// CHECK: %[[OVER:.*]] = warp.gt(%[[SUM]],
// CHECK: scf.if %[[OVER]] {
// CHECK-NEXT: } else {
// CHECK: warp.accumulate
// CHECK-NOT: scf.while
// CHECK-NOT: scf.for
// CHECK: return
func.func @left(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: ui32)
    attributes {warp.kernel} {
  %zero = warp.constant 0.0 : f32
  %limit = warp.constant 1.0 : f32
  %false = warp.constant false
  %true = warp.constant true
  %c0 = warp.constant 0 : ui32
  %c1 = warp.constant 1 : ui32
  %i = warp.tid : si32
  %r:3 = scf.while (%k = %c0, %done = %false, %s = %zero)
      : (ui32, i1, f32) -> (ui32, i1, f32) {
    %inside = warp.lt(%k, %n) : (ui32, ui32) -> i1
    %on = warp.unot(%done) : (i1) -> i1
    %more = warp.bit_and(%inside, %on) : (i1, i1) -> i1
    scf.condition(%more) %k, %done, %s : ui32, i1, f32
  } do {
  ^bb0(%k: ui32, %done: i1, %s: f32):
    %over = warp.gt(%s, %limit) : (f32, f32) -> i1
    %t:2 = scf.if %over -> (f32, i1) {
      scf.yield %s, %true : f32, i1
    } else {
      %v = warp.load %x[%k] : !warp.array<1 x f32>, ui32 -> f32
      %w = warp.mul(%v, %v) : (f32, f32) -> f32
      %u = warp.add(%s, %w) : (f32, f32) -> f32
      scf.yield %u, %done : f32, i1
    }
    %next = warp.add(%k, %c1) : (ui32, ui32) -> ui32
    scf.yield %next, %t#1, %t#0 : ui32, i1, f32
  }
  warp.store %r#2, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// The values that the condition's region passes on need not be those that the
// loop carries: the last evaluation, which ends the loop, is reversed before
// the iterations, which all threads that are in step are reversed for: each
// skips those that it has not made.
// CHECK-LABEL: func.func @passed_adjoint
// CHECK: %[[COUNTED:.*]]:3 = scf.while
// CHECK: %[[LAST:.*]] = warp.cos(%[[COUNTED]]#2)
// CHECK: %[[G:.*]] = warp.mul(%{{.*}}, %[[LAST]])
// CHECK: %[[MOST:.*]] = warp.most_trips %[[COUNTED]]#1
// CHECK: scf.while (%{{.*}} = %[[MOST]], %{{.*}} = %{{.*}}, %{{.*}} = %[[G]])
// CHECK: scf.for unsigned %[[K:[a-z0-9]+]] =
// CHECK: %[[MADE:.*]] = arith.cmpi ult, %[[K]], %[[COUNTED]]#1 {warp.in_step}
// CHECK: scf.if %[[MADE]]
// CHECK: warp.sin
// CHECK: scf.for
// CHECK: %[[MADE:.*]] = arith.cmpi ult, %{{.*}}, %[[COUNTED]]#1 {warp.in_step}
// CHECK: scf.if %[[MADE]]
// CHECK: warp.cos
func.func @passed(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %half = warp.constant 0.5 : f32
  %i = warp.tid : si32
  %first = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %r = scf.while (%s = %first) : (f32) -> f32 {
    %t = warp.sin(%s) : (f32) -> f32
    %more = warp.gt(%t, %half) : (f32, f32) -> i1
    scf.condition(%more) %t : f32
  } do {
  ^bb0(%t: f32):
    %u = warp.mul(%t, %t) : (f32, f32) -> f32
    scf.yield %u : f32
  }
  warp.store %r, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// How often a loop with a condition runs is counted where it runs forward; a
// factor that is the same each time needs no more than that, and the trips of
// the threads that are in step.
// CHECK-LABEL: func.func @halved_adjoint
// CHECK: %[[COUNTED:.*]]:2 = scf.while
// CHECK: warp.gt
// CHECK: arith.addi
// CHECK: %[[MOST:.*]] = warp.most_trips %[[COUNTED]]#1
// CHECK: scf.for unsigned %{{.*}} = %{{.*}} to %[[MOST]]
// CHECK-NOT: warp.scratch
// CHECK: warp.mul
// CHECK: warp.accumulate
func.func @halved(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %half = warp.constant 0.5 : f32
  %least = warp.constant 0.001 : f32
  %i = warp.tid : si32
  %first = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %s = scf.while (%t = %first) : (f32) -> f32 {
    %more = warp.gt(%t, %least) : (f32, f32) -> i1
    scf.condition(%more) %t : f32
  } do {
  ^bb0(%t: f32):
    %u = warp.mul(%t, %half) : (f32, f32) -> f32
    scf.yield %u : f32
  }
  warp.store %s, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

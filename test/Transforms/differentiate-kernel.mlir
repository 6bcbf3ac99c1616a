// RUN: warp-opt %s --warp-differentiate-kernel=active=11 --split-input-file | FileCheck %s --check-prefix=RAW
// RUN: warp-opt %s --warp-differentiate-kernel=active=11 --canonicalize --cse --warp-clean-up-adjoint --split-input-file | FileCheck %s

// The forward sweep is the kernel without its effects, then come its operations
// backwards. A stored element's gradient is taken, and left zero; nothing is
// atomic, because every thread has an element of its own.
// RAW-LABEL: func.func @square_adjoint
// RAW: warp.load %arg0
// RAW: warp.sin
// RAW-NOT: warp.store {{.*}}, %arg1
// CHECK-LABEL: func.func @square_adjoint
// CHECK-SAME: warp.needed = [0]
// CHECK-DAG: %[[DX:.*]] = warp.grad %arg0
// CHECK-DAG: %[[DY:.*]] = warp.grad %arg1
// CHECK-DAG: %[[ZERO:.*]] = warp.constant 0.0
// CHECK-DAG: %[[I:.*]] = warp.tid : si32
// CHECK: %[[X:.*]] = warp.load %arg0[%[[I]]]
// CHECK: %[[G:.*]] = warp.load %[[DY]][%[[I]]]
// CHECK: warp.store %[[ZERO]], %[[DY]][%[[I]]]
// CHECK: %[[C:.*]] = warp.cos(%[[X]])
// CHECK: %[[R:.*]] = warp.mul(%[[G]], %[[C]])
// CHECK: warp.accumulate %[[R]], %[[DX]][%[[I]]] {unique = 1 : i64}
func.func @square(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %s = warp.sin(%v) : (f32) -> f32
  warp.store %s, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// The factor of a sum is all that is needed: x itself is not read. Components
// of a cotangent are summed before they are one vector.
// CHECK-LABEL: func.func @components_adjoint
// CHECK-SAME: warp.needed = []
// CHECK: %[[A:.*]] = warp.load
// CHECK: %[[B:.*]] = warp.mul(%[[A]], %arg2)
// CHECK: %[[S:.*]] = warp.add(
// CHECK: %[[V:.*]] = warp.construct(%[[S]], %{{.*}}, %{{.*}})
// CHECK: warp.accumulate %[[V]]
// CHECK-NOT: warp.accumulate
func.func @components(%x: !warp.array<1 x !warp.vec<3 x f32>>,
                      %y: !warp.array<1 x f32>, %s: f32)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %c0 = warp.constant 0 : si32
  %c2 = warp.constant 2 : si32
  %v = warp.load %x[%i] : !warp.array<1 x !warp.vec<3 x f32>>, si32 -> !warp.vec<3 x f32>
  %a = warp.extract %v[%c0] : !warp.vec<3 x f32>, si32 -> f32
  %b = warp.extract %v[%c2] : !warp.vec<3 x f32>, si32 -> f32
  %t = warp.mul(%a, %s) : (f32, f32) -> f32
  %u = warp.add(%t, %b) : (f32, f32) -> f32
  %w = warp.add(%u, %a) : (f32, f32) -> f32
  warp.store %w, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// A branch is reversed on the condition of the forward sweep and yields what it
// contributes to values outside. The value of the branch is not needed.
// CHECK-LABEL: func.func @branch_adjoint
// CHECK: %[[X:.*]] = warp.load %arg0
// CHECK: %[[G:.*]] = warp.load
// CHECK: %[[R:.*]] = scf.if %arg2 -> (f32) {
// CHECK: warp.cos(%[[X]])
// CHECK: } else {
// CHECK-NEXT: scf.yield %[[G]]
// CHECK: warp.accumulate %[[R]]
func.func @branch(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %f: i1)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %r = scf.if %f -> (f32) {
    %s = warp.sin(%v) : (f32) -> f32
    scf.yield %s : f32
  } else {
    scf.yield %v : f32
  }
  warp.store %r, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// Gradients of 16-bit floats, and what is computed with them, have 32 bits.
// CHECK-LABEL: func.func @half_adjoint
// CHECK: warp.grad %arg0 : !warp.array<1 x f16> -> !warp.array<1 x f32>
// CHECK: warp.cast %{{.*}} : f16 to f32
// CHECK: warp.mul({{.*}}) : (f32, f32) -> f32
// CHECK: warp.accumulate %{{.*}} : f32, !warp.array<1 x f32>, si32
func.func @half(%x: !warp.array<1 x f16>, %y: !warp.array<1 x f16>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x f16>, si32 -> f16
  %s = warp.mul(%v, %v) : (f16, f16) -> f16
  warp.store %s, %y[%i] : f16, !warp.array<1 x f16>, si32
  return
}

// -----

// Without a gradient of x there is no code for x, and none of the gradient of y
// but that it is taken.
// RUN: warp-opt %s --warp-differentiate-kernel=active=01 --canonicalize --cse --warp-clean-up-adjoint --split-input-file | FileCheck %s --check-prefix=NOX
// NOX-LABEL: func.func @inactive_adjoint
// NOX-NOT: warp.grad %arg0
// NOX-NOT: warp.load
// NOX: warp.store %{{.*}}, %{{.*}}
// NOX-NOT: warp.accumulate
func.func @inactive(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %s = warp.mul(%v, %v) : (f32, f32) -> f32
  warp.store %s, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// A gradient that stops at an integer is said once, at its line.
// CHECK-LABEL: func.func @stops_adjoint
// CHECK-SAME: warp.notices = ["a.py:7:4: gradient stops at the conversion to an integer"]
func.func @stops(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %n = warp.cast %v : f32 to si32 loc("a.py":7:4)
  %m = warp.add(%n, %n) : (si32, si32) -> si32
  %w = warp.cast %m : si32 to f32
  %s = warp.mul(%v, %w) : (f32, f32) -> f32
  warp.store %s, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

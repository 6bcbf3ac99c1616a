// RUN: warp-opt %s --split-input-file --warp-differentiate-kernel=active=11 | FileCheck %s --check-prefix=RAW
// RUN: warp-opt %s --split-input-file --warp-differentiate-kernel=active=11 --canonicalize --cse --warp-simplify-adjoint --canonicalize --cse --warp-clean-up-adjoint | FileCheck %s --check-prefix=CLEAN
// RUN: warp-opt %s --split-input-file --warp-differentiate-kernel="mode=forward active=11" | FileCheck %s --check-prefix=FORWARD

// Derivatives as they are built, and after what nothing needs has gone.

// Built are the primal's loop, one that keeps what it carries, and the reverse
// one. The first is dead, since an adjoint does not store results.
// RAW-LABEL: func.func @product_adjoint
// RAW: %[[SUM:.*]] = scf.for
// RAW-NOT: warp.scratch
// RAW: scf.yield
// RAW: %[[G:.*]] = warp.load
// RAW: warp.store %{{.*}}
// RAW: %[[KEPT:.*]] = warp.scratch : !warp.scratch<8 x f32>
// RAW: scf.for unsigned
// RAW: warp.scratch_store %{{.*}}, %[[KEPT]]
// RAW: scf.for unsigned {{.*}}iter_args(%[[COTANGENT:.*]] = %[[G]])
// RAW: %[[BEFORE:.*]] = warp.scratch_load %[[KEPT]]
// RAW: warp.mul(%[[BEFORE]], %[[COTANGENT]])
// RAW: warp.accumulate
// CLEAN-LABEL: func.func @product_adjoint
// CLEAN: warp.scratch : !warp.scratch<8 x f32>
// CLEAN-COUNT-2: scf.for
// CLEAN-NOT: scf.for
// CLEAN: return
// The twins of both arrays are arguments; the loop carries value and tangent.
// FORWARD-LABEL: func.func @product
// FORWARD-SAME: kind = tangent, leaf = 0
// FORWARD-SAME: kind = tangent, leaf = 1
// FORWARD: scf.for {{.*}} -> (f32, f32)
// FORWARD-COUNT-2: warp.store
func.func @product(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %one = warp.constant 1.0 : f32
  %c0 = arith.constant 0 : index
  %c1 = arith.constant 1 : index
  %c8 = arith.constant 8 : index
  %i = warp.tid : si32
  %p = scf.for %k = %c0 to %c8 step %c1 iter_args(%carry = %one) -> f32 {
    %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
    %next = warp.mul(%carry, %v) : (f32, f32) -> f32
    scf.yield %next : f32
  }
  warp.store %p, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// The old contents are an argument from the start, whether needed or not; a
// sum does not need them.
// RAW-LABEL: func.func @shift_adjoint
// RAW-SAME: warp.hidden = #warp.hidden<kind = preserved, leaf = 0>
// RAW: %[[GRADIENT:.*]] = warp.grad %arg0
// RAW: %[[G:.*]] = warp.load %[[GRADIENT]]
// RAW: warp.store %{{.*}}, %[[GRADIENT]]
// RAW: warp.accumulate %{{.*}}, %[[GRADIENT]]
// CLEAN-LABEL: func.func @shift_adjoint
// CLEAN-NOT: preserved
// CLEAN: return
func.func @shift(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %a = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %b = warp.load %y[%i] : !warp.array<1 x f32>, si32 -> f32
  %sum = warp.add(%a, %b) : (f32, f32) -> f32
  warp.store %sum, %x[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// The branches are replayed, which nothing needs here, and reversed.
// RAW-LABEL: func.func @branch_adjoint
// RAW-COUNT-2: scf.if
// RAW: warp.accumulate
// CLEAN-LABEL: func.func @branch_adjoint
// CLEAN: scf.if
// CLEAN-NOT: scf.if
// CLEAN: return
func.func @branch(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>,
                  %c: i1) attributes {warp.kernel} {
  %i = warp.tid : si32
  %r = scf.if %c -> f32 {
    %a = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
    %p = warp.mul(%a, %a) : (f32, f32) -> f32
    scf.yield %p : f32
  } else {
    %a = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
    %s = warp.sin(%a) : (f32) -> f32
    scf.yield %s : f32
  }
  warp.store %r, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// RUN: warp-opt %s --split-input-file --warp-form-launch --warp-apply-schedules --warp-emit-entry --warp-order-accesses --mlir-print-local-scope | FileCheck %s

#gpu = #warp.variant<target = <name = "sm_90">, disjoint = true>

// The store waits for the load, and the load does not wait for the arithmetic.
// The constant is stored last.
// CHECK-LABEL: llvm.func {{.*}}@adjoint
// CHECK: warp.load_components
// CHECK: warp.load_components
// CHECK: math.cos
// CHECK: %[[SUM:.*]] = arith.addf
// CHECK-NEXT: warp.store_components(%[[SUM]])
// CHECK-NEXT: warp.store_components(%cst)
func.func @adjoint(%dx: !warp.array<1 x f32>, %dy: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #gpu} {
  %i = warp.tid : i32
  %zero = arith.constant 0.0 : f32
  %g = warp.load_components %dy[%i] : !warp.array<1 x f32>, i32 -> f32
  warp.store_components(%zero), %dy[%i] : (f32), !warp.array<1 x f32>, i32
  %c = math.cos %g : f32
  %h = warp.load_components %dx[%i] : !warp.array<1 x f32>, i32 -> f32
  %s = arith.addf %h, %c : f32
  warp.store_components(%s), %dx[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, disjoint = true>

// Stores to one array keep their order, a constant goes behind others only.
// CHECK-LABEL: llvm.func {{.*}}@cleared_first
// CHECK: %[[X:.*]] = warp.load_components
// CHECK: warp.store_components(%cst)
// CHECK-NEXT: warp.store_components(%[[X]])
// CHECK-NEXT: warp.store_components(%[[X]])
// CHECK-NEXT: warp.store_components(%cst)
func.func @cleared_first(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>,
                         %z: !warp.array<1 x f32>, %j: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %i = warp.tid : i32
  %zero = arith.constant 0.0 : f32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  warp.store_components(%zero), %y[%j] : (f32), !warp.array<1 x f32>, i32
  warp.store_components(%zero), %x[%i] : (f32), !warp.array<1 x f32>, i32
  warp.store_components(%v), %y[%i] : (f32), !warp.array<1 x f32>, i32
  warp.store_components(%v), %z[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">>

// Where arrays may overlap, the load may be of what was stored.
// CHECK-LABEL: llvm.func {{.*}}@overlapping
// CHECK: warp.load_components
// CHECK: warp.store_components
// CHECK: warp.load_components
func.func @overlapping(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #gpu} {
  %i = warp.tid : i32
  %zero = arith.constant 0.0 : f32
  %g = warp.load_components %y[%i] : !warp.array<1 x f32>, i32 -> f32
  warp.store_components(%zero), %y[%i] : (f32), !warp.array<1 x f32>, i32
  %h = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  warp.store_components(%h), %x[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, disjoint = true>

// An array's own elements may be the same one; its gradient's are others. Equal
// loads are one, unless a write to the array is between them.
// CHECK-LABEL: llvm.func {{.*}}@own
// CHECK: %[[X:.*]] = warp.parameter %{{.*}}[24]
// CHECK: %[[G:.*]] = warp.grad %[[X]]
// CHECK: warp.load_components %[[G]][
// CHECK: %[[A:.*]] = warp.load_components %[[X]][
// CHECK: warp.store_components(%[[A]]), %[[X]][
// CHECK: %[[B:.*]] = warp.load_components %[[X]][
// CHECK-NOT: warp.load_components
// CHECK: %[[SUM:.*]] = arith.addf %[[B]], %[[B]]
// CHECK: warp.store_components(%[[SUM]]), %[[G]][
func.func @own(%x: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #gpu} {
  %i = warp.tid : i32
  %one = arith.constant 1 : i32
  %j = arith.addi %i, %one : i32
  %dx = warp.grad %x : !warp.array<1 x f32> -> !warp.array<1 x f32>
  %g = warp.load_components %dx[%i] : !warp.array<1 x f32>, i32 -> f32
  %a = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  warp.store_components(%a), %x[%j] : (f32), !warp.array<1 x f32>, i32
  %b = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  warp.store_components(%g), %dx[%i] : (f32), !warp.array<1 x f32>, i32
  %c = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %sum = arith.addf %b, %c : f32
  warp.store_components(%sum), %dx[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, underfilled = true, disjoint = true>

// Nothing passes an update whose old value is used: it may be a lock.
// CHECK-LABEL: llvm.func {{.*}}@lock
// CHECK: warp.store_components
// CHECK: warp.atomic_components
// CHECK: warp.load_components
// CHECK: warp.store_components
func.func @lock(%x: !warp.array<1 x f32>, %lock: !warp.array<1 x si32>)
    attributes {warp.kernel, warp.variant = #gpu} {
  %i = warp.tid : i32
  %zero = arith.constant 0.0 : f32
  warp.store_components(%zero), %x[%i] : (f32), !warp.array<1 x f32>, i32
  %j = warp.atomic_components exch(%i), %lock[%i]
    : (i32), !warp.array<1 x si32>, i32 -> i32
  %v = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
  warp.store_components(%v), %x[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, underfilled = true, disjoint = true>

// A store passes a loop that loads from other arrays; the load after the loop
// stays there, but in front of the store.
// CHECK-LABEL: llvm.func {{.*}}@loop
// CHECK-NOT: warp.store_components
// CHECK: scf.for
// CHECK: warp.load_components
// CHECK: }
// CHECK: warp.load_components
// CHECK: warp.store_components
// CHECK-NEXT: warp.store_components
func.func @loop(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>,
                %z: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %i = warp.tid : i32
  %zero = arith.constant 0.0 : f32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  warp.store_components(%zero), %y[%i] : (f32), !warp.array<1 x f32>, i32
  %sum = scf.for %j = %c0 to %n step %c1 iter_args(%s = %zero) -> f32 : i32 {
    %v = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
    %t = arith.addf %s, %v : f32
    scf.yield %t : f32
  }
  %h = warp.load_components %z[%i] : !warp.array<1 x f32>, i32 -> f32
  %r = arith.addf %h, %sum : f32
  warp.store_components(%r), %z[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

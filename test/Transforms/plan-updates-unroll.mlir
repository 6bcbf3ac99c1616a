// RUN: warp-opt %s --split-input-file --warp-form-launch \
// RUN:     --warp-plan-updates --warp-combine-over-groups | FileCheck %s

#cpu = #warp.variant<target = <name = "cpu", bits = 128>>

// A short loop over parameters is unrolled: each element has a sum of its
// own, which is published once.
// CHECK-LABEL: func.func @parameters
// CHECK: %[[SUMS:.*]]:3 = warp.threads attributes {kinds = array<i32: 0, 0, 0>, types = [f32, f32, f32]}
// CHECK-NOT: scf.for
// CHECK-NOT: warp.atomic_components
// CHECK: warp.yield %{{.*}}, %{{.*}}, %{{.*}} : f32, f32, f32
// CHECK: warp.once
// CHECK: %[[SIX:.*]] = arith.constant 6 : i32
// CHECK: warp.atomic_components add(%[[SUMS]]#0), %{{.*}}[%[[SIX]]]
// CHECK: warp.once
// CHECK: %[[FOUR:.*]] = arith.constant 4 : i32
// CHECK: warp.atomic_components add(%[[SUMS]]#1), %{{.*}}[%[[FOUR]]]
// CHECK: warp.once
// CHECK: %[[TWO:.*]] = arith.constant 2 : i32
// CHECK: warp.atomic_components add(%[[SUMS]]#2), %{{.*}}[%[[TWO]]]
// CHECK-NOT: warp.atomic_components
func.func @parameters(%x: !warp.array<1 x f32>, %w: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %c0 = arith.constant 0 : i32
  %c2 = arith.constant 2 : i32
  %c6 = arith.constant 6 : i32
  %one = arith.constant 1.0 : f32
  %i = warp.tid : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %end = scf.for unsigned %k = %c0 to %c6 step %c2 iter_args(%p = %one)
      -> (f32) : i32 {
    %j = arith.subi %c6, %k : i32
    %old = warp.atomic_components add(%p), %w[%j]
      : (f32), !warp.array<1 x f32>, i32 -> f32
    %next = arith.mulf %p, %v : f32
    scf.yield %next : f32
  }
  warp.store_components(%end), %x[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 128>>

// Too many for registers.
// CHECK-LABEL: func.func @many
// CHECK: scf.for
func.func @many(%x: !warp.array<1 x f32>, %w: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %c17 = arith.constant 17 : i32
  %i = warp.tid : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  scf.for %k = %c0 to %c17 step %c1 : i32 {
    %old = warp.atomic_components add(%v), %w[%k]
      : (f32), !warp.array<1 x f32>, i32 -> f32
  }
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 128>>

// Elements that differ from thread to thread, and updates that are looked at.
// CHECK-LABEL: func.func @others
// CHECK-COUNT-2: scf.for
func.func @others(%x: !warp.array<1 x f32>, %w: !warp.array<1 x f32>,
                  %y: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %c4 = arith.constant 4 : i32
  %i = warp.tid : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  scf.for %k = %c0 to %c4 step %c1 : i32 {
    %j = arith.addi %i, %k : i32
    %old = warp.atomic_components add(%v), %w[%j]
      : (f32), !warp.array<1 x f32>, i32 -> f32
  }
  scf.for %k = %c0 to %c4 step %c1 : i32 {
    %old = warp.atomic_components add(%v), %y[%k]
      : (f32), !warp.array<1 x f32>, i32 -> f32
    warp.store_components(%old), %x[%i] : (f32), !warp.array<1 x f32>, i32
  }
  return
}

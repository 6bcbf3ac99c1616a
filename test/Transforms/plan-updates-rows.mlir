// RUN: warp-opt %s --split-input-file --warp-form-launch --warp-plan-updates | FileCheck %s

#gpu = #warp.variant<target = <name = "sm_90">>

// A thread adds along a row of its own: nothing waits for atomic additions.
// CHECK-LABEL: func @rows
// CHECK: scf.for
// CHECK: %[[V:.*]] = warp.load_components %{{.*}}[%[[I:.*]], %[[K:.*]]]
// CHECK: %[[P:.*]] = arith.mulf %[[V]], %[[V]]
// CHECK-NEXT: warp.atomic_components add(%[[P]]), %{{.*}}[%[[I]], %[[K]]]
// CHECK-NOT: store_components
func.func @rows(%x: !warp.array<2 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : i32
  %g = warp.grad %x : !warp.array<2 x f32> -> !warp.array<2 x f32>
  scf.for %k = %c0 to %n step %c1 : i32 {
    %v = warp.load_components %x[%i, %k] : !warp.array<2 x f32>, i32, i32 -> f32
    %old = warp.load_components %g[%i, %k] : !warp.array<2 x f32>, i32, i32 -> f32
    %sum = math.fma %v, %v, %old : f32
    warp.store_components(%sum), %g[%i, %k] : (f32), !warp.array<2 x f32>, i32, i32
  }
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">>

// Neighbours add to one stretch of memory, and a recurrence reads what it adds.
// CHECK-LABEL: func @others
// CHECK-NOT: atomic_components
func.func @others(%x: !warp.array<2 x f32>, %y: !warp.array<2 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : i32
  %g = warp.grad %x : !warp.array<2 x f32> -> !warp.array<2 x f32>
  %h = warp.grad %y : !warp.array<2 x f32> -> !warp.array<2 x f32>
  scf.for %k = %c0 to %n step %c1 : i32 {
    %next = arith.addi %k, %c1 : i32
    %v = warp.load_components %h[%i, %next] : !warp.array<2 x f32>, i32, i32 -> f32
    %a = warp.load_components %g[%k, %i] : !warp.array<2 x f32>, i32, i32 -> f32
    %b = arith.addf %a, %v : f32
    warp.store_components(%b), %g[%k, %i] : (f32), !warp.array<2 x f32>, i32, i32
    %c = warp.load_components %h[%i, %k] : !warp.array<2 x f32>, i32, i32 -> f32
    %d = arith.addf %c, %v : f32
    warp.store_components(%d), %h[%i, %k] : (f32), !warp.array<2 x f32>, i32, i32
  }
  return
}

// -----

#same = #warp.variant<target = <name = "sm_90">, deterministic = true>

// A product that is added with one rounding keeps its bits.
// CHECK-LABEL: func @deterministic
// CHECK-NOT: atomic_components
func.func @deterministic(%x: !warp.array<2 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #same} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : i32
  %g = warp.grad %x : !warp.array<2 x f32> -> !warp.array<2 x f32>
  scf.for %k = %c0 to %n step %c1 : i32 {
    %v = warp.load_components %x[%i, %k] : !warp.array<2 x f32>, i32, i32 -> f32
    %old = warp.load_components %g[%i, %k] : !warp.array<2 x f32>, i32, i32 -> f32
    %sum = math.fma %v, %v, %old : f32
    warp.store_components(%sum), %g[%i, %k] : (f32), !warp.array<2 x f32>, i32, i32
  }
  return
}

// RUN: warp-opt %s --split-input-file --warp-form-launch \
// RUN:     --warp-plan-updates --warp-combine-over-groups | FileCheck %s

#cpu = #warp.variant<target = <name = "cpu", bits = 256>>

// Threads yield their terms for one element; the group adds them up, and one of
// its threads publishes the total.
// CHECK-LABEL: func.func @one_address
// CHECK: %[[SUM:.*]] = warp.threads attributes {kinds = array<i32: 0>, types = [f32]} {
// CHECK: %[[V:.*]] = warp.load_components
// CHECK-NOT: warp.atomic_components
// CHECK: warp.yield %[[V]] : f32
// CHECK: } : f32
// CHECK-NEXT: warp.once {
// CHECK: warp.atomic_components add(%[[SUM]]), %arg1[%
func.func @one_address(%x: !warp.array<1 x f32>, %sum: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %old = warp.atomic_components add(%v), %sum[%c0]
    : (f32), !warp.array<1 x f32>, i32 -> f32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>>

// An update in a branch leaves it with what changes nothing, -0, and a flag: a
// group of which no thread came here leaves the array alone.
// CHECK-LABEL: func.func @branch
// CHECK: %[[ALL:.*]]:2 = warp.threads attributes {kinds = array<i32: 0, 5>, types = [f32, i1]} {
// CHECK-DAG: %[[NONE:.*]] = arith.constant -0.000000e+00 : f32
// CHECK-DAG: %[[FALSE:.*]] = arith.constant false
// CHECK: %[[PAIR:.*]]:2 = scf.if %{{.*}} -> (f32, i1) {
// CHECK: %[[TRUE:.*]] = arith.constant true
// CHECK: scf.yield %[[V:.*]], %[[TRUE]]
// CHECK: } else {
// CHECK: scf.yield %[[NONE]], %[[FALSE]]
// CHECK: warp.yield %[[PAIR]]#0, %[[PAIR]]#1
// CHECK: scf.if %[[ALL]]#1 {
// CHECK: warp.once {
// CHECK: warp.atomic_components add(%[[ALL]]#0)
func.func @branch(%x: !warp.array<1 x f32>, %sum: !warp.array<1 x f32>,
                  %b: i1)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  scf.if %b {
    %old = warp.atomic_components add(%v), %sum[%c0]
      : (f32), !warp.array<1 x f32>, i32 -> f32
  }
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>>

// Loops carry the sums of their iterations; a difference is the sum of what is
// negated.
// CHECK-LABEL: func.func @loops
// CHECK: warp.threads attributes {kinds = array<i32: 0, 5>, types = [f32, i1]} {
// CHECK: %[[OUTER:.*]]:2 = scf.for {{.*}} iter_args(%[[OF_FOR:.*]] = %{{.*}}, %[[CAME:.*]] = %{{.*}}) -> (f32, i1)
// CHECK: %[[INNER:.*]]:3 = scf.while (%{{.*}} = %{{.*}}, %{{.*}} = %{{.*}}, %{{.*}} = %{{.*}}) : (i32, f32, i1)
// CHECK: } do {
// CHECK: ^bb0(%{{.*}}: i32, %[[SO_FAR:.*]]: f32, %[[WAS:.*]]: i1):
// CHECK: %[[TERM:.*]] = arith.negf
// CHECK: %[[NEXT:.*]] = arith.addf %[[SO_FAR]], %[[TERM]] fastmath<reassoc>
// CHECK: %[[NOW:.*]] = arith.ori %[[WAS]]
// CHECK: scf.yield %{{.*}}, %[[NEXT]], %[[NOW]]
// CHECK: %[[SUM:.*]] = arith.addf %[[OF_FOR]], %[[INNER]]#1 fastmath<reassoc>
// CHECK: %[[CAME_NOW:.*]] = arith.ori %[[CAME]], %[[INNER]]#2
// CHECK: scf.yield %[[SUM]], %[[CAME_NOW]]
// CHECK: warp.yield %[[OUTER]]#0, %[[OUTER]]#1
// CHECK: warp.atomic_components add(
// CHECK-NOT: warp.atomic_components
func.func @loops(%x: !warp.array<1 x f32>, %sum: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  scf.for %j = %c0 to %n step %c1 : i32 {
    %end = scf.while (%k = %j) : (i32) -> i32 {
      %more = arith.cmpi slt, %k, %n : i32
      scf.condition(%more) %k : i32
    } do {
    ^bb0(%k: i32):
      %v = warp.load_components %x[%k] : !warp.array<1 x f32>, i32 -> f32
      %old = warp.atomic_components sub(%v), %sum[%c0]
        : (f32), !warp.array<1 x f32>, i32 -> f32
      %next = arith.addi %k, %c1 : i32
      scf.yield %next : i32
    }
  }
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>>

// Several sums, each by its own kind; an element's components are apart.
// CHECK-LABEL: func.func @several
// CHECK: %[[ALL:.*]]:4 = warp.threads attributes {kinds = array<i32: 0, 0, 3, 2>, types = [f32, f32, ui32, si32]} {
// CHECK: } : f32, f32, i32, i32
// CHECK: warp.once
// CHECK: warp.atomic_components add(%[[ALL]]#0, %[[ALL]]#1), %arg1[
// CHECK: warp.once
// CHECK: warp.atomic_components max(%[[ALL]]#2), %arg2[
// CHECK: warp.once
// CHECK: warp.atomic_components min(%[[ALL]]#3), %arg3[
func.func @several(%x: !warp.array<1 x !warp.vec<2 x f32>>,
                   %sum: !warp.array<1 x !warp.vec<2 x f32>>,
                   %most: !warp.array<1 x ui32>, %least: !warp.array<1 x si32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %v:2 = warp.load_components %x[%i]
    : !warp.array<1 x !warp.vec<2 x f32>>, i32 -> f32, f32
  %a:2 = warp.atomic_components add(%v#0, %v#1), %sum[%c0]
    : (f32, f32), !warp.array<1 x !warp.vec<2 x f32>>, i32 -> f32, f32
  %b = warp.atomic_components max(%i), %most[%c0]
    : (i32), !warp.array<1 x ui32>, i32 -> i32
  %c = warp.atomic_components min(%i), %least[%c0]
    : (i32), !warp.array<1 x si32>, i32 -> i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>>

// Gradients add up many contributions of similar size: their sum has 64 bits.
// CHECK-LABEL: func.func @gradient
// CHECK: %[[SUM:.*]] = warp.threads attributes {kinds = array<i32: 0>, types = [f64]} {
// CHECK: %[[WIDE:.*]] = arith.extf %{{.*}} : f32 to f64
// CHECK: warp.yield %[[WIDE]] : f64
// CHECK: warp.once
// CHECK: %[[TOTAL:.*]] = arith.truncf %[[SUM]] : f64 to f32
// CHECK: warp.atomic_components add(%[[TOTAL]])
func.func @gradient(%x: !warp.array<1 x f32>, %p: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %g = warp.grad %p : !warp.array<1 x f32> -> !warp.array<1 x f32>
  %old = warp.atomic_components add(%v), %g[%c0]
    : (f32), !warp.array<1 x f32>, i32 -> f32
  return
}

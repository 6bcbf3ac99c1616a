// RUN: warp-opt %s --split-input-file --warp-form-launch --warp-plan-updates \
// RUN:     --warp-widen-threads | FileCheck %s

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 3,
      lanes = 4>

// Terms of all lanes for one element are combined first, with the neutral
// element for lanes that are not live what changes nothing; a difference adds
// what is negated.
// CHECK-LABEL: func.func @one_element
// CHECK: ^bb0(%{{.*}}: i32, %[[LIVE:.*]]: vector<4xi1>):
// CHECK: %[[V:.*]] = warp.load_lanes
// CHECK: scf.for %[[K:[^ ]+]] =
// CHECK: %[[NONE:.*]] = arith.constant dense<-0.000000e+00> : vector<4xf32>
// CHECK: %[[TERM:.*]] = arith.negf %[[V]]
// CHECK: %[[TERMS:.*]] = arith.select %[[LIVE]], %[[TERM]], %[[NONE]]
// CHECK: %[[SUM:.*]] = warp.combine_lanes %[[TERMS]] {kind = 0 : i32, type = f32}
// CHECK: warp.atomic_components add(%[[SUM]]), %arg0[%[[K]]]
func.func @one_element(%s: !warp.array<1 x f32>, %x: !warp.array<1 x f32>,
                       %n: i32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  scf.for %k = %c0 to %n step %c1 : i32 {
    %old = warp.atomic_components sub(%v), %s[%k]
      : (f32), !warp.array<1 x f32>, i32 -> f32
  }
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 3,
      lanes = 4>

// An old value that is used, or an exchange, says which lane was first: they
// are serialised, with what they share as it is.
// CHECK-LABEL: func.func @turns
// CHECK: ^bb0(%{{.*}}: i32, %[[LIVE:.*]]: vector<4xi1>):
// CHECK: %[[V:.*]] = warp.load_lanes
// CHECK: %[[OLD:.*]] = warp.each_lane %[[LIVE]](%[[V]]) {
// CHECK-NEXT: ^bb0(%[[ONE:.*]]: f32):
// CHECK-NEXT: %[[WAS:.*]] = warp.atomic_components exch(%[[ONE]]), %arg0[%arg2]
// CHECK-NEXT: warp.yield %[[WAS]] : f32
// CHECK: warp.store_lanes unit(%[[OLD]]), %arg1
// CHECK: warp.each_lane %[[LIVE]](%{{.*}}) {
// CHECK: warp.atomic_cas
func.func @turns(%s: !warp.array<1 x f32>, %x: !warp.array<1 x f32>, %n: i32,
                 %a: f32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %old = warp.atomic_components exch(%v), %s[%n]
    : (f32), !warp.array<1 x f32>, i32 -> f32
  warp.store_components(%old), %x[%i] : (f32), !warp.array<1 x f32>, i32
  %was = warp.atomic_cas %a, %v, %s[%n]
    : f32, f32, !warp.array<1 x f32>, i32 -> f32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 3,
      lanes = 4>

// A store of different values into one element: the last thread's stays.
// CHECK-LABEL: func.func @one_place
// CHECK: warp.each_lane %{{.*}}(%[[V:.*]]) {
// CHECK-NEXT: ^bb0(%[[ONE:.*]]: f32):
// CHECK-NEXT: warp.store_components(%[[ONE]]), %arg0[%arg2]
func.func @one_place(%s: !warp.array<1 x f32>, %x: !warp.array<1 x f32>,
                     %n: i32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  warp.store_components(%v), %s[%n] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 3,
      lanes = 4>

// In code that runs alone, neighbours that update neighbours do not meet: their
// update is a load and a store. Index -1 is the last element, which another
// lane may update, and so may half the index: these stay updates.
// CHECK-LABEL: func.func @neighbours
// CHECK: %[[V:.*]] = warp.load_lanes unit %arg1
// CHECK: %[[OLD:.*]] = warp.load_lanes unit %arg0[%[[J:.*]]] mask %[[LIVE:[^ ]+]]
// CHECK: %[[NEW:.*]] = arith.addf %[[OLD]], %[[V]]
// CHECK: warp.store_lanes unit(%[[NEW]]), %arg0[%[[J]]] mask %[[LIVE]]
// CHECK-NOT: warp.store_lanes
// CHECK: warp.{{update_lanes|each_lane}}
// CHECK-NOT: warp.store_lanes
// CHECK: warp.{{update_lanes|each_lane}}
// CHECK-NOT: warp.store_lanes
// CHECK: warp.yield
// CHECK: return
func.func @neighbours(%s: !warp.array<1 x f32>, %x: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #cpu,
      warp.schedule = #warp.schedule<exclusive = true>} {
  %i = warp.tid : i32
  %c1 = arith.constant 1 : i32
  %c2 = arith.constant 2 : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %after = arith.addi %i, %c1 : i32
  %a = warp.atomic_components add(%v), %s[%after]
    : (f32), !warp.array<1 x f32>, i32 -> f32
  %before = arith.subi %i, %c1 : i32
  %b = warp.atomic_components add(%v), %s[%before]
    : (f32), !warp.array<1 x f32>, i32 -> f32
  %half = arith.divui %i, %c2 : i32
  %c = warp.atomic_components add(%v), %s[%half]
    : (f32), !warp.array<1 x f32>, i32 -> f32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 1,
      lanes = 4>

// Other threads may be at work on the neighbours: updates stay atomic.
// CHECK-LABEL: func.func @shared
// CHECK-NOT: warp.store_lanes
// CHECK: warp.{{update_lanes|each_lane}}
// CHECK-NOT: warp.store_lanes
// CHECK: return
func.func @shared(%s: !warp.array<1 x f32>, %a: f32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %old = warp.atomic_components add(%a), %s[%i]
    : (f32), !warp.array<1 x f32>, i32 -> f32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 7, non_negative = 4,
      lanes = 4>

// Neighbours mostly have the same quotient: where all lanes do, they are one
// update. Not so where a quotient is that of two neighbours only, or where an
// index was loaded.
// CHECK-LABEL: func.func @quotients
// CHECK: %[[V:.*]] = warp.load_lanes unit %arg1
// CHECK: %[[LEAST:.*]] = warp.combine_lanes %{{.*}} {kind = 2 : i32
// CHECK: %[[MOST:.*]] = warp.combine_lanes %{{.*}} {kind = 3 : i32
// CHECK: %[[IS_ONE:.*]] = arith.cmpi eq, %[[LEAST]], %[[MOST]]
// CHECK: scf.if %[[IS_ONE]] {
// CHECK: %[[TOTAL:.*]] = warp.combine_lanes
// CHECK: warp.atomic_components max(%[[TOTAL]]), %arg0[%[[LEAST]]]
// CHECK: } else {
// CHECK: warp.update_lanes max(%[[V]]), %arg0
// CHECK: }
// CHECK-NOT: scf.if
// CHECK: warp.update_lanes max
// CHECK-NOT: scf.if
// CHECK: warp.update_lanes max
// CHECK: return
func.func @quotients(%s: !warp.array<1 x f32>, %x: !warp.array<1 x f32>,
                     %at: !warp.array<1 x si32>, %n: i32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c2 = arith.constant 2 : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %row = arith.divsi %i, %n : i32
  %a = warp.atomic_components max(%v), %s[%row]
    : (f32), !warp.array<1 x f32>, i32 -> f32
  %pair = arith.divsi %i, %c2 : i32
  %b = warp.atomic_components max(%v), %s[%pair]
    : (f32), !warp.array<1 x f32>, i32 -> f32
  %j = warp.load_components %at[%i] : !warp.array<1 x si32>, i32 -> i32
  %k = arith.divsi %j, %n : i32
  %c = warp.atomic_components max(%v), %s[%k]
    : (f32), !warp.array<1 x f32>, i32 -> f32
  return
}

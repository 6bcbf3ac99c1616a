// RUN: warp-opt %s --split-input-file --warp-form-launch \
// RUN:     --warp-widen-threads | FileCheck %s

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 3,
      lanes = 4>

// Elements that follow each other are vectors; arithmetic has the mask's lanes,
// and a value that threads share is broadcast. The last lanes are not all live,
// so accesses have the mask.
// CHECK-LABEL: func.func @unit
// CHECK: warp.threads attributes {kinds = array<i32>, lanes = 4 : i64, types = []}
// CHECK-NEXT: ^bb0(%[[I:.*]]: i32, %[[LIVE:.*]]: vector<4xi1>):
// CHECK: %[[A:.*]] = warp.broadcast %arg2 : f32 -> vector<4xf32>
// CHECK: %[[V:.*]] = warp.load_lanes unit %arg0[%[[I]]] mask %[[LIVE]]
// CHECK: %[[W:.*]] = arith.mulf %[[V]], %[[A]] : vector<4xf32>
// CHECK: warp.store_lanes unit(%[[W]]), %arg1[%[[I]]] mask %[[LIVE]]
func.func @unit(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %a: f32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %w = arith.mulf %v, %a : f32
  warp.store_components(%w), %y[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 1,
      lanes = 4>

// Components of packed elements are vectors, too.
// CHECK-LABEL: func.func @aos
// CHECK: ^bb0(%[[I:.*]]: i32, %[[LIVE:.*]]: vector<4xi1>):
// CHECK: %[[V:.*]]:3 = warp.load_lanes unit %arg0[%[[I]]] mask %[[LIVE]]
// CHECK-SAME: -> vector<4xf32>, vector<4xf32>, vector<4xf32>
// CHECK: warp.store_lanes unit(%[[V]]#2, %[[V]]#1, %[[V]]#0), %arg0[%[[I]]]
func.func @aos(%x: !warp.array<1 x !warp.vec<3 x f32>>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %v:3 = warp.load_components %x[%i]
    : !warp.array<1 x !warp.vec<3 x f32>>, i32 -> f32, f32, f32
  warp.store_components(%v#2, %v#1, %v#0), %x[%i]
    : (f32, f32, f32), !warp.array<1 x !warp.vec<3 x f32>>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, rank = 2,
      packed = 3, lanes = 4>

// Only the last dimension has neighbours: a fixed row is unit, a column is not.
// CHECK-LABEL: func.func @rows
// CHECK: ^bb0(%[[ROW:.*]]: i32, %[[I:.*]]: i32, %{{.*}}: vector<4xi1>):
// CHECK: %[[LANES:.*]] = arith.addi %{{.*}}, %{{.*}} : vector<4xi32>
// CHECK: warp.load_lanes unit %arg0[%[[ROW]], %[[I]]]
// CHECK: warp.store_lanes gather(%{{.*}}), %arg1[%[[LANES]], %[[ROW]]]
func.func @rows(%x: !warp.array<2 x f32>, %y: !warp.array<2 x f32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %j, %i = warp.tid : i32, i32
  %v = warp.load_components %x[%j, %i] : !warp.array<2 x f32>, i32, i32 -> f32
  warp.store_components(%v), %y[%i, %j]
    : (f32), !warp.array<2 x f32>, i32, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 3,
      lanes = 4>

// Arrays that are not packed and indices that were loaded are gathered; stores
// two elements apart are masked vectors. Index -1 is the last element: a
// difference of the thread's index is not unit, a sum is.
// CHECK-LABEL: func.func @gather
// CHECK: ^bb0(%[[I:.*]]: i32, %{{.*}}: vector<4xi1>):
// CHECK: %[[LANES:.*]] = arith.addi %{{.*}}, %{{.*}} : vector<4xi32>
// CHECK: %[[AT:.*]] = warp.load_lanes unit %arg0[%[[I]]]
// CHECK: warp.load_lanes gather %arg1[%[[AT]]] {{.*}}nonNegative = array<i1: false>
// CHECK: %[[BEFORE:.*]] = arith.subi %[[LANES]], %{{.*}} : vector<4xi32>
// CHECK: warp.load_lanes gather %arg1[%[[BEFORE]]] {{.*}}nonNegative = array<i1: false>
// CHECK: %[[AFTER:.*]] = arith.addi %[[I]], %{{.*}} : i32
// CHECK: warp.load_lanes unit %arg1[%[[AFTER]]]
// CHECK: warp.load_lanes gather %arg2[%[[LANES]]]
// CHECK: %[[TWICE:.*]] = arith.addi %[[I]], %[[I]]
// CHECK: warp.store_lanes unit(%{{.*}}), %arg1[%[[TWICE]]] {{.*}}stride = 2
func.func @gather(%at: !warp.array<1 x si32>, %x: !warp.array<1 x f32>,
                  %strided: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c1 = arith.constant 1 : i32
  %j = warp.load_components %at[%i] : !warp.array<1 x si32>, i32 -> i32
  %a = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
  %before = arith.subi %i, %c1 : i32
  %b = warp.load_components %x[%before] : !warp.array<1 x f32>, i32 -> f32
  %after = arith.addi %i, %c1 : i32
  %c = warp.load_components %x[%after] : !warp.array<1 x f32>, i32 -> f32
  %d = warp.load_components %strided[%i] : !warp.array<1 x f32>, i32 -> f32
  %twice = arith.addi %i, %i : i32
  %s = arith.addf %a, %b : f32
  %t = arith.addf %c, %d : f32
  %u = arith.addf %s, %t : f32
  warp.store_components(%u), %x[%twice] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 3,
      lanes = 4>

// A guard says that the index before is there.
// CHECK-LABEL: func.func @guarded
// CHECK: %[[BEFORE:.*]] = arith.subi %{{.*}}, %{{.*}} : i32
// CHECK: warp.load_lanes unit %arg0[%[[BEFORE]]]
func.func @guarded(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %has = arith.cmpi sgt, %i, %c0 : i32
  scf.if %has {
    %before = arith.subi %i, %c1 : i32
    %b = warp.load_components %x[%before] : !warp.array<1 x f32>, i32 -> f32
    warp.store_components(%b), %y[%i] : (f32), !warp.array<1 x f32>, i32
  }
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 3,
      lanes = 4>

// Values that threads share stay scalar, loops and loads included, until a lane
// needs it.
// CHECK-LABEL: func.func @uniform
// CHECK: arith.mulf %arg3, %arg3 : f32
// CHECK: %[[SUM:.*]] = scf.for %[[K:[^ ]+]] = {{.*}} -> (f32)
// CHECK: %[[V:.*]] = warp.load_components %arg0[%[[K]]]
// CHECK: arith.addf %{{.*}}, %[[V]] : f32
// CHECK: %[[LANES:.*]] = warp.broadcast %[[SUM]] : f32 -> vector<4xf32>
// CHECK: warp.store_lanes unit(%[[LANES]])
func.func @uniform(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>,
                   %n: i32, %a: f32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %b = arith.mulf %a, %a : f32
  %r = scf.for %k = %c0 to %n step %c1 iter_args(%s = %b) -> f32 : i32 {
    %v = warp.load_components %x[%k] : !warp.array<1 x f32>, i32 -> f32
    %t = arith.addf %s, %v : f32
    scf.yield %t : f32
  }
  warp.store_components(%r), %y[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 3,
      lanes = 4>

// Where a row begins differs from thread to thread: the array itself is
// accessed, with all indices.
// CHECK-LABEL: func.func @view
// CHECK: ^bb0(%[[I:.*]]: i32, %{{.*}}: vector<4xi1>):
// CHECK: %[[LANES:.*]] = arith.addi %{{.*}}, %{{.*}} : vector<4xi32>
// CHECK-NOT: warp.view
// CHECK: warp.load_lanes gather %arg0[%[[LANES]], %arg2]
func.func @view(%x: !warp.array<2 x f32>, %y: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %row = warp.view %x[%i] : !warp.array<2 x f32>, i32 -> !warp.array<1 x f32>
  %v = warp.load_components %row[%n] : !warp.array<1 x f32>, i32 -> f32
  warp.store_components(%v), %y[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 3,
      lanes = 4>

// Memory of a thread has a value per lane in each slot; lanes that are not live
// keep theirs.
// CHECK-LABEL: func.func @scratch
// CHECK: ^bb0(%{{.*}}: i32, %[[LIVE:.*]]: vector<4xi1>):
// CHECK: %[[MEMORY:.*]] = warp.scratch : !warp.scratch<8 x vector<4xf32>>
// CHECK: scf.for %[[K:[^ ]+]] =
// CHECK: %[[V:.*]] = warp.load_lanes
// CHECK: %[[OLD:.*]] = warp.scratch_load %[[MEMORY]][%[[K]]]
// CHECK: %[[NEW:.*]] = arith.select %[[LIVE]], %[[V]], %[[OLD]]
// CHECK: warp.scratch_store %[[NEW]], %[[MEMORY]][%[[K]]]
func.func @scratch(%s: !warp.array<1 x f32>, %x: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %m = warp.scratch : !warp.scratch<8 x f32>
  scf.for %k = %c0 to %n step %c1 : i32 {
    %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
    warp.scratch_store %v, %m[%k] : f32, !warp.scratch<8 x f32>, i32
  }
  %u = warp.scratch_load %m[%c1] : !warp.scratch<8 x f32>, i32 -> f32
  warp.store_components(%u), %s[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 3,
      lanes = 4>

// Lanes may use different slots; one that is not live uses the first.
// CHECK-LABEL: func.func @slots
// CHECK: ^bb0(%{{.*}}: i32, %[[LIVE:.*]]: vector<4xi1>):
// CHECK: %[[AT:.*]] = warp.load_lanes unit %arg1
// CHECK: %[[FIRST:.*]] = arith.constant dense<0> : vector<4xi32>
// CHECK: %[[SLOT:.*]] = arith.select %[[LIVE]], %[[AT]], %[[FIRST]]
// CHECK: warp.scratch_load %{{.*}}[%[[SLOT]]]
func.func @slots(%x: !warp.array<1 x f32>, %at: !warp.array<1 x si32>, %a: f32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c1 = arith.constant 1 : i32
  %m = warp.scratch : !warp.scratch<8 x f32>
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  warp.scratch_store %v, %m[%c1] : f32, !warp.scratch<8 x f32>, i32
  %j = warp.load_components %at[%i] : !warp.array<1 x si32>, i32 -> i32
  %u = warp.scratch_load %m[%j] : !warp.scratch<8 x f32>, i32 -> f32
  warp.store_components(%u), %x[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 3,
      lanes = 4>

// Lanes become saturated integers together: what is beyond the limits or no
// number is replaced before the conversion.
// CHECK-LABEL: func.func @saturate
// CHECK-NOT: warp.each_lane
// CHECK: %[[X:.*]] = warp.load_lanes unit %arg0
// CHECK: %[[LOW:.*]] = arith.cmpf ole, %[[X]], %{{.*}} : vector<4xf32>
// CHECK: %[[HIGH:.*]] = arith.cmpf oge, %[[X]], %{{.*}} : vector<4xf32>
// CHECK: arith.cmpf ord, %[[X]], %[[X]]
// CHECK: %[[I:.*]] = arith.fptosi %{{.*}} : vector<4xf32> to vector<4xi32>
// CHECK: %[[J:.*]] = arith.select %[[LOW]], %{{.*}}, %[[I]]
// CHECK: %[[K:.*]] = arith.select %[[HIGH]], %{{.*}}, %[[J]]
// CHECK: warp.store_lanes unit(%[[K]]), %arg1
func.func @saturate(%x: !warp.array<1 x f32>, %y: !warp.array<1 x si32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %w = llvm.call_intrinsic "llvm.fptosi.sat.i32.f32"(%v) : (f32) -> i32
  warp.store_components(%w), %y[%i] : (i32), !warp.array<1 x si32>, i32
  return
}

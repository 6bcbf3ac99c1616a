// RUN: warp-opt %s --split-input-file --warp-form-launch \
// RUN:     --warp-widen-threads | FileCheck %s

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 3, non_negative = 2,
      lanes = 4>

// Lanes with bounds of their own leave a loop one by one; it ends with the
// last. Only values that are used afterwards are held as they leave: the
// second sum is not. The remaining lanes agree on the counter and on all that
// depends on it, which stay scalars.
// CHECK-LABEL: func.func @own_bounds
// CHECK: ^bb0(%[[I:.*]]: i32, %[[LIVE:.*]]: vector<4xi1>):
// CHECK: %[[ENDS:.*]] = arith.addi %{{.*}}, %{{.*}} : vector<4xi32>
// CHECK: %[[LOOP:.*]]:5 = scf.while (%[[LEFT:[^ ]+]] = %[[LIVE]], %[[HELD:[^ ]+]] = %{{[^,]+}}, %[[K:[^ ]+]] = %{{[^,]+}}, %{{[^,]+}} = %arg2, %{{[^,]+}} = %arg2)
// CHECK-SAME: : (vector<4xi1>, vector<4xf32>, i32, f32, f32)
// CHECK: %[[KS:.*]] = warp.broadcast %[[K]]
// CHECK: %[[INSIDE:.*]] = arith.cmpi slt, %[[KS]], %[[ENDS]] : vector<4xi32>
// CHECK: %[[GO:.*]] = arith.andi %[[LEFT]], %[[INSIDE]]
// CHECK: %[[ANY:.*]] = warp.any %[[GO]]
// CHECK: scf.condition(%[[ANY]]) %[[GO]], %[[HELD]], %[[K]]
// CHECK: ^bb0(%[[MASK:[^:]+]]: vector<4xi1>, %[[WAS:[^:]+]]: vector<4xf32>, %[[J:[^:]+]]: i32, %[[S:[^:]+]]: f32
// CHECK: %[[V:.*]] = warp.load_components %arg0[%[[J]]]
// CHECK: %[[T:.*]] = arith.addf %[[S]], %[[V]] : f32
// CHECK: %[[TS:.*]] = warp.broadcast %[[T]]
// CHECK: %[[NOW:.*]] = arith.select %[[MASK]], %[[TS]], %[[WAS]]
// CHECK: %[[NEXT:.*]] = arith.addi %[[J]], %{{.*}} : i32
// CHECK: scf.yield %[[MASK]], %[[NOW]], %[[NEXT]], %[[T]]
// CHECK: warp.store_lanes unit(%[[LOOP]]#1), %arg1[%[[I]]] mask %[[LIVE]]
func.func @own_bounds(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>,
                      %z: f32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %r:2 = scf.for %k = %c0 to %i step %c1 iter_args(%s = %z, %u = %z)
      -> (f32, f32) : i32 {
    %v = warp.load_components %x[%k] : !warp.array<1 x f32>, i32 -> f32
    %t = arith.addf %s, %v : f32
    %w = arith.mulf %u, %v : f32
    scf.yield %t, %w : f32, f32
  }
  warp.store_components(%r#0), %y[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 1,
      lanes = 4>

// Lanes that begin at different places count in vectors, beside the first
// lane's scalar, which finds the elements that follow each other.
// CHECK-LABEL: func.func @own_begin
// CHECK: scf.while ({{.*}}) : (vector<4xi1>, vector<4xi32>, i32)
// CHECK: ^bb0(%[[MASK:.*]]: vector<4xi1>, %[[KS:.*]]: vector<4xi32>, %[[K:.*]]: i32):
// CHECK: warp.store_lanes unit({{.*}}), %arg0[%[[K]]] mask %[[MASK]]
// CHECK-DAG: arith.addi %[[KS]], %{{.*}} : vector<4xi32>
// CHECK-DAG: arith.addi %[[K]], %{{.*}} : i32
func.func @own_begin(%x: !warp.array<1 x f32>, %z: f32, %n: i32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c8 = arith.constant 8 : i32
  scf.for %k = %i to %n step %c8 : i32 {
    warp.store_components(%z), %x[%k] : (f32), !warp.array<1 x f32>, i32
  }
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 3, non_negative = 2,
      lanes = 4>

// As the loop's condition depends on the lane, so do its results, but not what
// counts in it.
// CHECK-LABEL: func.func @escape
// CHECK: ^bb0(%[[I:.*]]: i32, %[[LIVE:.*]]: vector<4xi1>):
// CHECK: %[[LOOP:.*]]:4 = scf.while (%[[WAS:[^ ]+]] = %[[LIVE]], %[[HELD:[^ ]+]] = %{{[^,]+}}, %[[Z:[^ ]+]] = %{{[^,]+}}, %[[K:[^ ]+]] = %{{[^)]+}})
// CHECK-SAME: : (vector<4xi1>, vector<4xi32>, vector<4xf32>, i32)
// CHECK: %[[KS:.*]] = warp.broadcast %[[K]]
// CHECK: %[[MORE:.*]] = arith.cmpf olt, %[[Z]]
// CHECK: %[[GO:.*]] = arith.andi %[[WAS]], %[[MORE]]
// CHECK: %[[HOLD:.*]] = arith.select %[[WAS]], %[[KS]], %[[HELD]]
// CHECK: %[[ANY:.*]] = warp.any %[[GO]]
// CHECK: scf.condition(%[[ANY]]) %[[GO]], %[[HOLD]], %[[Z]], %[[K]]
// CHECK: arith.mulf %{{.*}} : vector<4xf32>
// CHECK: arith.addi %{{.*}} : i32
// CHECK: warp.store_lanes unit(%[[LOOP]]#1), %arg1[%[[I]]] mask %[[LIVE]]
func.func @escape(%x: !warp.array<1 x f32>, %y: !warp.array<1 x si32>,
                  %limit: f32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %r:2 = scf.while (%z = %v, %k = %c0) : (f32, i32) -> (f32, i32) {
    %more = arith.cmpf olt, %z, %limit : f32
    scf.condition(%more) %z, %k : f32, i32
  } do {
  ^bb0(%z: f32, %k: i32):
    %w = arith.mulf %z, %z : f32
    %m = arith.addi %k, %c1 : i32
    scf.yield %w, %m : f32, i32
  }
  warp.store_components(%r#1), %y[%i] : (i32), !warp.array<1 x si32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 1,
      lanes = 4>

// A loop that all lanes leave together needs no mask.
// CHECK-LABEL: func.func @together
// CHECK: ^bb0(%{{.*}}: i32, %[[LIVE:.*]]: vector<4xi1>):
// CHECK-NOT: warp.any
// CHECK: %[[R:.*]]:2 = scf.while (%{{.*}} = %{{.*}}, %[[K:[^ ]+]] = %{{.*}}) : (vector<4xf32>, i32) -> (vector<4xf32>, i32) {
// CHECK: %[[MORE:.*]] = arith.cmpi slt, %[[K]], %arg1 : i32
// CHECK: scf.condition(%[[MORE]])
// CHECK: warp.store_lanes unit(%[[R]]#0), %arg0[{{.*}}] mask %[[LIVE]]
func.func @together(%x: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %r:2 = scf.while (%z = %v, %k = %c0) : (f32, i32) -> (f32, i32) {
    %more = arith.cmpi slt, %k, %n : i32
    scf.condition(%more) %z, %k : f32, i32
  } do {
  ^bb0(%z: f32, %k: i32):
    %w = arith.mulf %z, %z : f32
    %m = arith.addi %k, %c1 : i32
    scf.yield %w, %m : f32, i32
  }
  warp.store_components(%r#0), %x[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 3, non_negative = 2,
      lanes = 4>

// A loop whose end nobody else decides waits for no one, whatever it reads and
// writes on the way.
// CHECK-LABEL: func.func @own_end
// CHECK: scf.while
// CHECK: warp.load_lanes
func.func @own_end(%x: !warp.array<2 x f32>, %n: i32, %z: f32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %sum:2 = scf.while (%k = %n, %s = %z) : (i32, f32) -> (i32, f32) {
    %more = arith.cmpi ne, %k, %c0 : i32
    scf.condition(%more) %k, %s : i32, f32
  } do {
  ^bb0(%k: i32, %s: f32):
    %j = arith.subi %k, %c1 : i32
    %v = warp.load_components %x[%j, %i]
      : !warp.array<2 x f32>, i32, i32 -> f32
    warp.store_components(%s), %x[%j, %i]
      : (f32), !warp.array<2 x f32>, i32, i32
    %t = arith.addf %s, %v : f32
    scf.yield %j, %t : i32, f32
  }
  return
}

// -----

#lanes = #warp.variant<target = <name = "cpu", bits = 256>, lanes = 4>

// A march through a volume ends by what it reads there, which no thread waits
// for, though the array that is written may have the same memory.
// CHECK-LABEL: func.func @march
// CHECK: warp.load_lanes
func.func @march(%volume: i64, %y: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #lanes} {
  %i = warp.tid : i32
  %zero = arith.constant 0 : i32
  %one = arith.constant 1 : i32
  %kind = arith.constant 4 : i32
  %size = arith.constant 32 : i32
  %width = arith.constant 16 : i32
  %none = arith.constant 0.0 : f32
  %end = scf.while (%k = %i, %more = %one) : (i32, i32) -> i32 {
    %goes = arith.cmpi ne, %more, %zero : i32
    scf.condition(%goes) %k : i32
  } do {
  ^bb0(%k: i32):
    %address = warp.library_call "warp_slot"(%volume, %kind) : (i64, i32) -> i64
    %slot = warp.array_at %address[%size] : i64, i32 -> !warp.array<1 x ui64>
    %grid = warp.load_components %slot[%one]
      : !warp.array<1 x ui64>, i32 -> i64
    %rows = warp.array_at %grid[%size, %width]
      : i64, i32, i32 -> !warp.array<2 x f32>
    %v = warp.load_components %rows[%k, %zero]
      : !warp.array<2 x f32>, i32, i32 -> f32
    %is_out = arith.cmpf ogt, %v, %none : f32
    %again = arith.extui %is_out : i1 to i32
    %next = arith.addi %k, %one : i32
    scf.yield %next, %again : i32, i32
  }
  %far = arith.sitofp %end : i32 to f32
  warp.store_components(%far), %y[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

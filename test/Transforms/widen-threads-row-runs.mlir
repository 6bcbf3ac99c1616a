// RUN: warp-opt %s --split-input-file --warp-form-launch \
// RUN:     --warp-widen-threads | FileCheck %s

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 3, non_negative = 4,
      disjoint = true, lanes = 4>

// Lanes go along rows of their own: eight elements of each row are loaded
// together, and what is left behind the last eight one by one.
// CHECK-LABEL: func.func @sums
// CHECK: %[[RUNS:.*]] = arith.cmpi slt, %{{.*}}, %arg2 : i32
// CHECK: %[[TRIPS:.*]] = arith.andi
// CHECK: %[[WHOLE:.*]] = arith.select %[[RUNS]], %[[TRIPS]]
// CHECK: %[[MIDDLE:.*]] = arith.addi %{{.*}}, %[[WHOLE]]
// CHECK: scf.for %[[K:.*]] = %{{.*}} to %[[MIDDLE]] step %c8_i32 iter_args
// CHECK: %[[V:.*]]:8 = warp.load_lanes gather %arg0[%{{.*}}, %[[K]]] {{.*}}warp.run = 8
// CHECK-COUNT-8: arith.addf {{.*}} : vector<4xf32>
// CHECK: scf.yield
// CHECK: scf.for %{{.*}} = %[[MIDDLE]] to %arg2
// CHECK: warp.load_lanes gather
// CHECK-NOT: warp.run
func.func @sums(%x: !warp.array<2 x f32>, %y: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %z = arith.constant 0.0 : f32
  %s = scf.for %k = %c0 to %n step %c1 iter_args(%t = %z) -> (f32) : i32 {
    %v = warp.load_components %x[%i, %k] : !warp.array<2 x f32>, i32, i32 -> f32
    %u = arith.addf %t, %v : f32
    scf.yield %u : f32
  }
  warp.store_components(%s), %y[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 3, non_negative = 4,
      disjoint = true, lanes = 4>

// A row that the loop writes to at another element is read element by element;
// so is one that lanes go along by two.
// CHECK-LABEL: func.func @written
// CHECK-NOT: warp.run
// CHECK: return
func.func @written(%x: !warp.array<2 x f32>, %y: !warp.array<2 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %c2 = arith.constant 2 : i32
  scf.for %k = %c0 to %n step %c1 : i32 {
    %v = warp.load_components %x[%i, %k] : !warp.array<2 x f32>, i32, i32 -> f32
    %u = arith.addf %v, %v : f32
    %j = arith.addi %k, %c2 : i32
    warp.store_components(%u), %x[%i, %j] : (f32), !warp.array<2 x f32>, i32, i32
  }
  scf.for %k = %c0 to %n step %c2 : i32 {
    %v = warp.load_components %y[%i, %k] : !warp.array<2 x f32>, i32, i32 -> f32
    warp.store_components(%v), %x[%i, %k] : (f32), !warp.array<2 x f32>, i32, i32
  }
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 3, non_negative = 4,
      disjoint = true, lanes = 4>

// An iteration that changes the element that it has read does so to no other:
// eight are loaded, changed and stored together. A row that is followed back to
// front begins, in memory, at the element of the last iteration.
// CHECK-LABEL: func.func @in_place
// CHECK: scf.for %[[K:.*]] = %{{.*}} to %{{.*}} step %c8_i32
// CHECK: %[[AT:.*]] = arith.subi %{{.*}}, %[[K]]
// CHECK: %[[FIRST:.*]] = arith.subi %[[AT]], %c7_i32
// CHECK: %[[V:.*]]:8 = warp.load_lanes gather %arg0[%{{.*}}, %[[FIRST]]] {{.*}}warp.run = 8
// CHECK: %[[HEAD:.*]] = arith.addf %[[V]]#7, %[[V]]#7
// CHECK-COUNT-6: arith.addf
// CHECK: %[[TAIL:.*]] = arith.addf %[[V]]#0, %[[V]]#0
// CHECK: warp.store_lanes gather(%[[TAIL]], {{.*}}, %[[HEAD]]), %arg0[%{{.*}}, {{.*}}warp.run = 8
// CHECK: return
func.func @in_place(%x: !warp.array<2 x f32>, %y: !warp.array<2 x f32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %c15 = arith.constant 15 : i32
  %c16 = arith.constant 16 : i32
  scf.for %k = %c0 to %c16 step %c1 : i32 {
    %at = arith.subi %c15, %k : i32
    %v = warp.load_components %x[%i, %at] : !warp.array<2 x f32>, i32, i32 -> f32
    %u = arith.addf %v, %v : f32
    warp.store_components(%u), %x[%i, %at] : (f32), !warp.array<2 x f32>, i32, i32
  }
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 3, non_negative = 4,
      disjoint = true, lanes = 4>

// Eight elements of each row are stored together, behind the last of their
// iterations.
// CHECK-LABEL: func.func @stored
// CHECK: scf.for %[[K:.*]] = %{{.*}} to %{{.*}} step %c8_i32 iter_args
// CHECK: warp.load_lanes gather %arg0[%{{.*}}, %[[K]]] {{.*}}warp.run = 8
// CHECK-NOT: warp.store_lanes
// CHECK-COUNT-8: arith.addf {{.*}} : vector<4xf32>
// CHECK: warp.store_lanes gather({{.*}}), %arg1[%{{.*}}, %[[K]]] {{.*}}warp.run = 8
// CHECK: scf.yield
// CHECK: scf.for
// CHECK: warp.store_lanes gather(
// CHECK-NOT: warp.run
// CHECK: return
func.func @stored(%x: !warp.array<2 x f32>, %y: !warp.array<2 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %z = arith.constant 0.0 : f32
  %s = scf.for %k = %c0 to %n step %c1 iter_args(%t = %z) -> (f32) : i32 {
    %v = warp.load_components %x[%i, %k] : !warp.array<2 x f32>, i32, i32 -> f32
    %u = arith.addf %t, %v : f32
    warp.store_components(%u), %y[%i, %k] : (f32), !warp.array<2 x f32>, i32, i32
    scf.yield %u : f32
  }
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 3, non_negative = 4,
      lanes = 4>

// Arrays may overlap: an iteration may read what the one before has stored.
// CHECK-LABEL: func.func @overlapping
// CHECK-NOT: warp.run
// CHECK: return
func.func @overlapping(%x: !warp.array<2 x f32>, %y: !warp.array<2 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  scf.for %k = %c0 to %n step %c1 : i32 {
    %v = warp.load_components %x[%i, %k] : !warp.array<2 x f32>, i32, i32 -> f32
    %u = arith.addf %v, %v : f32
    warp.store_components(%u), %y[%i, %k] : (f32), !warp.array<2 x f32>, i32, i32
  }
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 3, non_negative = 4,
      disjoint = true, lanes = 4>

// Scratch memory is the thread's own: rows are loaded in runs beside it.
// CHECK-LABEL: func.func @kept
// CHECK: warp.load_lanes gather %arg0{{.*}}warp.run = 8
// CHECK: warp.store_lanes gather({{.*}}), %arg1{{.*}}warp.run = 8
// CHECK: return
func.func @kept(%x: !warp.array<2 x f32>, %y: !warp.array<2 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %c7 = arith.constant 7 : i32
  %memory = warp.scratch : !warp.scratch<8 x f32>
  scf.for %k = %c0 to %n step %c1 : i32 {
    %slot = arith.andi %k, %c7 : i32
    %v = warp.load_components %x[%i, %k] : !warp.array<2 x f32>, i32, i32 -> f32
    warp.scratch_store %v, %memory[%slot] : f32, !warp.scratch<8 x f32>, i32
    warp.store_components(%v), %y[%i, %k] : (f32), !warp.array<2 x f32>, i32, i32
  }
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 3, non_negative = 4,
      disjoint = true, lanes = 4>

// Four bytes of a row are loaded together, and stored one by one; bools are
// loaded one by one.
// CHECK-LABEL: func.func @bytes
// CHECK: scf.for
// CHECK: warp.load_lanes gather %arg0{{.*}}warp.run = 4
// CHECK-NOT: warp.run
// CHECK: return
func.func @bytes(%x: !warp.array<2 x ui8>, %y: !warp.array<2 x i1>, %n: i32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  scf.for %k = %c0 to %n step %c1 : i32 {
    %v = warp.load_components %x[%i, %k] : !warp.array<2 x ui8>, i32, i32 -> i8
    %u = warp.load_components %y[%i, %k] : !warp.array<2 x i1>, i32, i32 -> i1
    %w = arith.extui %u : i1 to i8
    %t = arith.addi %v, %w : i8
    warp.store_components(%t), %x[%i, %k] : (i8), !warp.array<2 x ui8>, i32, i32
  }
  return
}

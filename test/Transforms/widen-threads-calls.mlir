// RUN: warp-opt %s --split-input-file --warp-form-launch \
// RUN:     --warp-widen-threads | FileCheck %s

#lanes = #warp.variant<target = <name = "cpu", bits = 256>, lanes = 4,
      disjoint = true>

// Lanes call a function together, with the mask of those that come to the call:
// arguments that differ are vectors, those that they share scalars. Its branches
// and loops are those of lanes.
// CHECK-LABEL: func.func private @sum_lanes(
// CHECK-SAME: %[[MASK:[^:]*]]: vector<4xi1>, %[[A:[^:]*]]: !warp.array<1 x f32>, %[[N:[^:]*]]: vector<4xi32>, %[[X:[^:]*]]: f32) -> vector<4xf32>
// CHECK: scf.while ({{.*}} = %[[MASK]]
// CHECK: warp.load_lanes gather %[[A]]
// CHECK-LABEL: func.func @branch
// CHECK: %[[IN:.*]] = warp.any
// CHECK: scf.if %[[IN]]
// CHECK: call @sum_lanes(%{{.*}}, %{{.*}}, %{{.*}}, %{{.*}}) : (vector<4xi1>, !warp.array<1 x f32>, vector<4xi32>, f32) -> vector<4xf32>
// CHECK-NOT: func.func private
func.func private @sum(%a: !warp.array<1 x f32>, %n: i32, %x: f32) -> f32
    attributes {warp.kept} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %s = scf.for %k = %c0 to %n step %c1 iter_args(%t = %x) -> f32 : i32 {
    %j = arith.muli %k, %n : i32
    %v = warp.load_components %a[%j] : !warp.array<1 x f32>, i32 -> f32
    %u = arith.addf %t, %v : f32
    scf.yield %u : f32
  }
  return %s : f32
}
func.func @branch(%a: !warp.array<1 x f32>, %m: !warp.array<1 x si32>,
                  %y: !warp.array<1 x f32>, %x: f32)
    attributes {warp.kernel, warp.keeps_calls, warp.variant = #lanes} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %n = warp.load_components %m[%i] : !warp.array<1 x si32>, i32 -> i32
  %some = arith.cmpi sgt, %n, %c0 : i32
  scf.if %some {
    %s = func.call @sum(%a, %n, %x) : (!warp.array<1 x f32>, i32, f32) -> f32
    warp.store_components(%s), %y[%i] : (f32), !warp.array<1 x f32>, i32
  }
  return
}

// -----

#lanes = #warp.variant<target = <name = "cpu", bits = 256>, lanes = 4,
      disjoint = true>

// A call that is the same for all lanes is one call of the function as it is.
// CHECK-LABEL: func.func private @first(
// CHECK-SAME: !warp.array<1 x f32>) -> f32
// CHECK-LABEL: func.func @shared
// CHECK: %[[V:.*]] = func.call @first(%{{.*}}) : (!warp.array<1 x f32>) -> f32
// CHECK: warp.broadcast %[[V]]
func.func private @first(%a: !warp.array<1 x f32>) -> f32
    attributes {warp.kept} {
  %c0 = arith.constant 0 : i32
  %v = warp.load_components %a[%c0] : !warp.array<1 x f32>, i32 -> f32
  return %v : f32
}
func.func @shared(%a: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.keeps_calls, warp.variant = #lanes} {
  %i = warp.tid : i32
  %v = func.call @first(%a) : (!warp.array<1 x f32>) -> f32
  warp.store_components(%v), %y[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#lanes = #warp.variant<target = <name = "cpu", bits = 256>, lanes = 4,
      disjoint = true>

// Rows of their own are passed as the array and their indices.
// CHECK-LABEL: func.func private @first_rows_lanes(
// CHECK-SAME: %[[MASK:[^:]*]]: vector<4xi1>, %[[A:[^:]*]]: !warp.array<2 x f32>, %[[I:[^:]*]]: vector<4xi32>) -> vector<4xf32>
// CHECK: warp.load_lanes gather %[[A]][%[[I]], %{{.*}}] mask %[[MASK]]
// CHECK-LABEL: func.func @rows
// CHECK: call @first_rows_lanes
// CHECK-NOT: func.func private
func.func private @first(%a: !warp.array<1 x f32>) -> f32
    attributes {warp.kept} {
  %c0 = arith.constant 0 : i32
  %v = warp.load_components %a[%c0] : !warp.array<1 x f32>, i32 -> f32
  return %v : f32
}
func.func @rows(%a: !warp.array<2 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.keeps_calls, warp.variant = #lanes} {
  %i = warp.tid : i32
  %row = warp.view %a[%i] : !warp.array<2 x f32>, i32 -> !warp.array<1 x f32>
  %v = func.call @first(%row) : (!warp.array<1 x f32>) -> f32
  warp.store_components(%v), %y[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#lanes = #warp.variant<target = <name = "cpu", bits = 256>, lanes = 4,
      disjoint = true>

// A function that may wait for what another thread writes keeps threads scalar.
// CHECK-LABEL: func.func private @wait(
// CHECK-LABEL: func.func @flag
// CHECK-SAME: "a loop may wait for another thread"
// CHECK-NOT: vector
func.func private @wait(%flags: !warp.array<1 x si32>, %i: i32) -> i32
    attributes {warp.kept} {
  %c0 = arith.constant 0 : i32
  %done = scf.while (%f = %c0) : (i32) -> i32 {
    %wait = arith.cmpi eq, %f, %c0 : i32
    scf.condition(%wait) %f : i32
  } do {
  ^bb0(%f: i32):
    %now = warp.load_components %flags[%i]
      : !warp.array<1 x si32>, i32 -> i32
    scf.yield %now : i32
  }
  return %done : i32
}
func.func @flag(%flags: !warp.array<1 x si32>)
    attributes {warp.kernel, warp.keeps_calls, warp.variant = #lanes} {
  %i = warp.tid : i32
  %c1 = arith.constant 1 : i32
  %before = arith.subi %i, %c1 : i32
  %d = func.call @wait(%flags, %before) : (!warp.array<1 x si32>, i32) -> i32
  warp.store_components(%c1), %flags[%i] : (i32), !warp.array<1 x si32>, i32
  return
}

// -----

#lanes = #warp.variant<target = <name = "cpu", bits = 256>, lanes = 4,
      disjoint = true>

// So does a loop of the kernel around a function that reads it.
// CHECK-LABEL: func.func @around
// CHECK-SAME: "a loop may wait for another thread"
// CHECK-NOT: vector
func.func private @read(%flags: !warp.array<1 x si32>, %i: i32) -> i32
    attributes {warp.kept} {
  %now = warp.load_components %flags[%i]
    : !warp.array<1 x si32>, i32 -> i32
  return %now : i32
}
func.func @around(%flags: !warp.array<1 x si32>)
    attributes {warp.kernel, warp.keeps_calls, warp.variant = #lanes} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %before = arith.subi %i, %c1 : i32
  scf.while : () -> () {
    %f = func.call @read(%flags, %before) : (!warp.array<1 x si32>, i32) -> i32
    %wait = arith.cmpi eq, %f, %c0 : i32
    scf.condition(%wait)
  } do {
    scf.yield
  }
  warp.store_components(%c1), %flags[%i] : (i32), !warp.array<1 x si32>, i32
  return
}

// -----

#lanes = #warp.variant<target = <name = "cpu", bits = 256>, lanes = 4,
      disjoint = true>

// The same loop over an array that nobody writes is one of lanes.
// CHECK-LABEL: func.func private @wait_lanes(
// CHECK: scf.while
// CHECK: warp.load_lanes
// CHECK-LABEL: func.func @search
func.func private @wait(%flags: !warp.array<1 x si32>, %i: i32) -> i32
    attributes {warp.kept} {
  %done = scf.while (%f = %i) : (i32) -> i32 {
    %wait = arith.cmpi ne, %f, %i : i32
    scf.condition(%wait) %f : i32
  } do {
  ^bb0(%f: i32):
    %now = warp.load_components %flags[%f]
      : !warp.array<1 x si32>, i32 -> i32
    scf.yield %now : i32
  }
  return %done : i32
}
func.func @search(%flags: !warp.array<1 x si32>, %y: !warp.array<1 x si32>)
    attributes {warp.kernel, warp.keeps_calls, warp.variant = #lanes} {
  %i = warp.tid : i32
  %d = func.call @wait(%flags, %i) : (!warp.array<1 x si32>, i32) -> i32
  warp.store_components(%d), %y[%i] : (i32), !warp.array<1 x si32>, i32
  return
}

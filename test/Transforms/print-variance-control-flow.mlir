// RUN: warp-opt %s --split-input-file --warp-print-variance -o /dev/null \
// RUN:   | FileCheck %s

// A shared condition joins what the arms yield; a condition of the thread's own
// makes the result its own, even where both arms are shared.
// CHECK-LABEL: variance of @branches
// CHECK: = warp.tid: step 1
// CHECK: scf.if: in step
// CHECK-NEXT: = scf.if: step 1
// CHECK-NEXT: = scf.if: varies
// CHECK-NEXT: = scf.if: uniform over the launch
// CHECK: scf.if: divergent
// CHECK-NEXT: = scf.if: varies
// CHECK-NEXT: = scf.if: varies
func.func @branches(%b: i1, %n: i32, %m: i32) attributes {warp.kernel} {
  %i = warp.tid : i32
  %j = arith.addi %i, %n : i32
  %k = arith.addi %i, %i : i32
  %own = arith.cmpi slt, %i, %n : i32
  %r:3 = scf.if %b -> (i32, i32, i32) {
    scf.yield %i, %i, %n : i32, i32, i32
  } else {
    scf.yield %j, %k, %m : i32, i32, i32
  }
  %s:2 = scf.if %own -> (i32, i32) {
    scf.yield %i, %n : i32, i32
  } else {
    scf.yield %j, %m : i32, i32
  }
  return
}

// -----

// With shared bounds the counter is one for the lanes, not for the launch, whose
// threads are in different iterations. A carried value keeps a step that the
// iterations leave as it is.
// CHECK-LABEL: variance of @counted
// CHECK: %[[I:.*]] = warp.tid: step 1
// CHECK: scf.for: in step
// CHECK-NEXT: = scf.for: uniform over lanes
// CHECK-NEXT: = scf.for: step 1
// CHECK-NEXT: = scf.for: varies
// CHECK-NEXT: %{{.*}}: uniform over lanes
// CHECK-NEXT: %{{.*}}: uniform over lanes
// CHECK-NEXT: %{{.*}}: step 1
// CHECK-NEXT: %{{.*}}: varies
func.func @counted(%n: i32) attributes {warp.kernel} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %r:3 = scf.for %k = %c0 to %n step %c1 iter_args(%a = %c0, %b = %i, %c = %c0)
      -> (i32, i32, i32) : i32 {
    %x = arith.addi %a, %k : i32
    %y = arith.addi %b, %k : i32
    %z = arith.addi %c, %i : i32
    scf.yield %x, %y, %z : i32, i32, i32
  }
  return
}

// -----

// Bounds that differ between threads: lanes leave one by one. The remaining
// lanes agree on the counter; afterwards lanes agree on nothing that the loop
// changed.
// CHECK-LABEL: variance of @own_end
// CHECK: = warp.tid: step 1
// CHECK: scf.for: divergent
// CHECK-NEXT: = scf.for: varies
// CHECK-NEXT: = scf.for: varies
// CHECK-NEXT: %{{.*}}: uniform over lanes
// CHECK-NEXT: %{{.*}}: uniform over lanes
// CHECK-NEXT: %{{.*}}: step 1
func.func @own_end(%n: i32) attributes {warp.kernel} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %r:2 = scf.for %k = %c0 to %i step %c1 iter_args(%a = %c0, %b = %i)
      -> (i32, i32) : i32 {
    %x = arith.addi %a, %k : i32
    %y = arith.addi %b, %k : i32
    scf.yield %x, %y : i32, i32
  }
  return
}

// -----

// A counter that begins at the index has its step, unless each thread has a
// stride of its own.
// CHECK-LABEL: variance of @own_begin
// CHECK: = warp.tid: step 1
// CHECK: scf.for: divergent
// CHECK-NEXT: %{{.*}}: step 1
// CHECK: scf.for: divergent
// CHECK-NEXT: %{{.*}}: varies
func.func @own_begin(%n: i32) attributes {warp.kernel} {
  %i = warp.tid : i32
  %c8 = arith.constant 8 : i32
  scf.for %k = %i to %n step %c8 : i32 {
  }
  scf.for %k = %c8 to %n step %i : i32 {
  }
  return
}

// -----

// A loop that ends by what only the thread knows: its results differ, what it
// counts does not while lanes are in it.
// CHECK-LABEL: variance of @escape
// CHECK: = warp.load_components: varies
// CHECK: scf.while: divergent
// CHECK-NEXT: = scf.while: varies
// CHECK-NEXT: = scf.while: varies
// CHECK-NEXT: %{{.*}}: varies
// CHECK-NEXT: %{{.*}}: uniform over lanes
// CHECK: = arith.cmpf: varies
// CHECK-NEXT: %{{.*}}: varies
// CHECK-NEXT: %{{.*}}: uniform over lanes
// CHECK: = arith.addi: uniform over lanes
func.func @escape(%x: !warp.array<1 x f32>, %limit: f32)
    attributes {warp.kernel} {
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
  return
}

// -----

// A loop that all lanes leave together leaves its counter shared by them. The
// flag that an iteration leaves to the next is found to be the thread's own only
// once the loop has been gone through: then the loop is divergent after all.
// CHECK-LABEL: variance of @whiles
// CHECK: = warp.tid: step 1
// CHECK: scf.while: in step
// CHECK-NEXT: = scf.while: uniform over lanes
// CHECK: scf.while: divergent
// CHECK-NEXT: = scf.while: varies
// CHECK-NEXT: %{{.*}}: varies
func.func @whiles(%x: !warp.array<1 x f32>, %n: i32, %b: i1)
    attributes {warp.kernel} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %end = scf.while (%k = %c0) : (i32) -> i32 {
    %more = arith.cmpi slt, %k, %n : i32
    scf.condition(%more) %k : i32
  } do {
  ^bb0(%k: i32):
    %m = arith.addi %k, %c1 : i32
    scf.yield %m : i32
  }
  %f = scf.while (%flag = %b) : (i1) -> i1 {
    scf.condition(%flag) %flag : i1
  } do {
  ^bb0(%flag: i1):
    %own = arith.cmpi slt, %i, %n : i32
    scf.yield %own : i1
  }
  return
}

// RUN: warp-opt %s --split-input-file --warp-form-launch --warp-apply-schedules --warp-emit-entry \
// RUN:     --warp-unroll-loops --mlir-print-local-scope | FileCheck %s

#gpu = #warp.variant<target = <name = "sm_90">>

// A loop through runs of a list, whose condition looks for the next run when
// one has ended. On a GPU each run is a loop inside, which gets copies; the
// outer loop goes on at its end.
// CHECK-LABEL: llvm.func {{.*}}@neighbours
// CHECK: scf.while
// CHECK: %[[SOUGHT:.*]]:3 = scf.while
// CHECK: arith.cmpi slt, %[[SOUGHT]]#1, %[[SOUGHT]]#2
// CHECK: ^bb0(%[[ROW:[^:]+]]: i32, %[[PLACE:[^:]+]]: i32, %[[END:[^:]+]]: i32, %[[S:[^:]+]]: f32):
// CHECK: %[[SUM:.*]] = scf.for %[[P:.*]] = %[[PLACE]] to %[[END]] step %{{.*}} iter_args(%[[T:.*]] = %[[S]]) -> (f32)
// CHECK: %[[J:.*]] = warp.load_components %{{.*}}[%[[P]]] : !warp.array<1 x si32>, i32 -> i32
// CHECK: %[[V:.*]] = warp.load_components %{{.*}}[%[[J]]] : !warp.array<1 x f32>, i32 -> f32
// CHECK: arith.addf %[[T]], %[[V]]
// CHECK: loop_annotation = #llvm.loop_annotation<unroll = <count = 4 : i32>>
// CHECK: scf.yield %[[ROW]], %[[END]], %[[END]], %[[SUM]]
func.func @neighbours(%grid: i64, %starts: !warp.array<1 x si32>,
                      %x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #gpu} {
  %i = warp.tid : i32
  %zero = arith.constant 0.0 : f32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %c3 = arith.constant 3 : i32
  %c11 = arith.constant 11 : i32
  %c32 = arith.constant 32 : i32
  %false = arith.constant false
  %slot = warp.library_call "warp_slot"(%grid, %c1) : (i64, i32) -> i64
  %words = warp.array_at %slot[%c32] : i64, i32 -> !warp.array<1 x ui64>
  %at = warp.load_components %words[%c11] : !warp.array<1 x ui64>, i32 -> i64
  %list = warp.array_at %at[%c32] : i64, i32 -> !warp.array<1 x si32>
  %self = warp.load_components %list[%i] : !warp.array<1 x si32>, i32 -> i32
  %r:4 = scf.while (%row = %c0, %p = %c0, %e = %c0, %s = %zero)
      : (i32, i32, i32, f32) -> (i32, i32, i32, f32) {
    %q:3 = scf.while (%row1 = %row, %p1 = %p, %e1 = %e)
        : (i32, i32, i32) -> (i32, i32, i32) {
      %ended = arith.cmpi sge, %p1, %e1 : i32
      %more = scf.if %ended -> (i1) {
        %left = arith.cmpi slt, %row1, %c3 : i32
        scf.yield %left : i1
      } else {
        scf.yield %false : i1
      }
      scf.condition(%more) %row1, %p1, %e1 : i32, i32, i32
    } do {
    ^bb0(%row1: i32, %p1: i32, %e1: i32):
      %cell = arith.addi %row1, %i : i32
      %behind = arith.addi %cell, %c1 : i32
      %begin = warp.load_components %starts[%cell] : !warp.array<1 x si32>, i32 -> i32
      %end = warp.load_components %starts[%behind] : !warp.array<1 x si32>, i32 -> i32
      %next = arith.addi %row1, %c1 : i32
      scf.yield %next, %begin, %end : i32, i32, i32
    }
    %in = arith.cmpi slt, %q#1, %q#2 : i32
    scf.condition(%in) %q#0, %q#1, %q#2, %s : i32, i32, i32, f32
  } do {
  ^bb0(%row: i32, %p: i32, %e: i32, %s: f32):
    %j = warp.load_components %list[%p] : !warp.array<1 x si32>, i32 -> i32
    %p2 = arith.addi %p, %c1 : i32
    %v = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
    %t = arith.addf %s, %v : f32
    scf.yield %row, %p2, %e, %t : i32, i32, i32, f32
  }
  warp.store_components(%r#3), %y[%self] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">>

// One that may be left in the middle of a run stays.
// CHECK-LABEL: llvm.func {{.*}}@leaves
// CHECK-NOT: scf.for
func.func @leaves(%grid: i64, %starts: !warp.array<1 x si32>,
                      %x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #gpu} {
  %i = warp.tid : i32
  %zero = arith.constant 0.0 : f32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %c3 = arith.constant 3 : i32
  %c11 = arith.constant 11 : i32
  %c32 = arith.constant 32 : i32
  %false = arith.constant false
  %most = arith.constant 9.0 : f32
  %slot = warp.library_call "warp_slot"(%grid, %c1) : (i64, i32) -> i64
  %words = warp.array_at %slot[%c32] : i64, i32 -> !warp.array<1 x ui64>
  %at = warp.load_components %words[%c11] : !warp.array<1 x ui64>, i32 -> i64
  %list = warp.array_at %at[%c32] : i64, i32 -> !warp.array<1 x si32>
  %self = warp.load_components %list[%i] : !warp.array<1 x si32>, i32 -> i32
  %r:4 = scf.while (%row = %c0, %p = %c0, %e = %c0, %s = %zero)
      : (i32, i32, i32, f32) -> (i32, i32, i32, f32) {
    %q:3 = scf.while (%row1 = %row, %p1 = %p, %e1 = %e)
        : (i32, i32, i32) -> (i32, i32, i32) {
      %ended = arith.cmpi sge, %p1, %e1 : i32
      %more = scf.if %ended -> (i1) {
        %left = arith.cmpi slt, %row1, %c3 : i32
        scf.yield %left : i1
      } else {
        scf.yield %false : i1
      }
      scf.condition(%more) %row1, %p1, %e1 : i32, i32, i32
    } do {
    ^bb0(%row1: i32, %p1: i32, %e1: i32):
      %cell = arith.addi %row1, %i : i32
      %behind = arith.addi %cell, %c1 : i32
      %begin = warp.load_components %starts[%cell] : !warp.array<1 x si32>, i32 -> i32
      %end = warp.load_components %starts[%behind] : !warp.array<1 x si32>, i32 -> i32
      %next = arith.addi %row1, %c1 : i32
      scf.yield %next, %begin, %end : i32, i32, i32
    }
    %has = arith.cmpi slt, %q#1, %q#2 : i32
    %few = arith.cmpf olt, %s, %most : f32
    %in = arith.andi %has, %few : i1
    scf.condition(%in) %q#0, %q#1, %q#2, %s : i32, i32, i32, f32
  } do {
  ^bb0(%row: i32, %p: i32, %e: i32, %s: f32):
    %j = warp.load_components %list[%p] : !warp.array<1 x si32>, i32 -> i32
    %p2 = arith.addi %p, %c1 : i32
    %v = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
    %t = arith.addf %s, %v : f32
    scf.yield %row, %p2, %e, %t : i32, i32, i32, f32
  }
  warp.store_components(%r#3), %y[%self] : (f32), !warp.array<1 x f32>, i32
  return
}

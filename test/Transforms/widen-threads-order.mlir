// RUN: warp-opt %s --split-input-file --warp-form-launch \
// RUN:     --warp-widen-threads | FileCheck %s

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 7, non_negative = 4,
      lanes = 4>

// Arrays may overlap under two names. Lanes perform one operation after the
// other, so each thread's accesses stay in its order: here it may read x[2i+1]
// only after it wrote y[2i+1]. The index i+i has step 2: taken for step 1 it
// would seem to leave nothing to overlap.
// CHECK-LABEL: func.func @twice
// CHECK: warp.load_lanes {{.*}}%arg0[
// CHECK: warp.store_lanes unit({{.*}}), %arg1[{{.*}}stride = 2
// CHECK: warp.load_lanes {{.*}}%arg0[
// CHECK: warp.store_lanes unit({{.*}}), %arg2[
func.func @twice(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>,
                 %z: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c1 = arith.constant 1 : i32
  %even = arith.addi %i, %i : i32
  %odd = arith.addi %even, %c1 : i32
  %a = warp.load_components %x[%even] : !warp.array<1 x f32>, i32 -> f32
  warp.store_components(%a), %y[%odd] : (f32), !warp.array<1 x f32>, i32
  %b = warp.load_components %x[%odd] : !warp.array<1 x f32>, i32 -> f32
  warp.store_components(%b), %z[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 7, non_negative = 4,
      lanes = 4>

// A component is read before, another after, a write that may be to the same
// element.
// CHECK-LABEL: func.func @between
// CHECK: %[[X1:.*]] = warp.component_view %arg0[%c1_i32]
// CHECK: %[[Y1:.*]] = warp.component_view %arg1[%c1_i32]
// CHECK: warp.load_lanes
// CHECK: warp.store_lanes {{.*}}%[[Y1]][
// CHECK: warp.load_lanes {{.*}}%[[X1]][
// CHECK: warp.store_lanes {{.*}}%arg2[
func.func @between(%x: !warp.array<1 x !warp.vec<2 x f32>>,
                   %y: !warp.array<1 x !warp.vec<2 x f32>>,
                   %z: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %x0 = warp.component_view %x[%c0]
    : !warp.array<1 x !warp.vec<2 x f32>>, i32 -> !warp.array<1 x f32>
  %x1 = warp.component_view %x[%c1]
    : !warp.array<1 x !warp.vec<2 x f32>>, i32 -> !warp.array<1 x f32>
  %y1 = warp.component_view %y[%c1]
    : !warp.array<1 x !warp.vec<2 x f32>>, i32 -> !warp.array<1 x f32>
  %a = warp.load_components %x0[%i] : !warp.array<1 x f32>, i32 -> f32
  warp.store_components(%a), %y1[%i] : (f32), !warp.array<1 x f32>, i32
  %b = warp.load_components %x1[%i] : !warp.array<1 x f32>, i32 -> f32
  warp.store_components(%b), %z[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 3,
      lanes = 4>

// Also where lanes have a form for one access and none for the other, and from
// one iteration to the next.
// CHECK-LABEL: func.func @iterations
// CHECK: scf.for
// CHECK: warp.load_lanes unit %arg0
// CHECK: warp.each_lane
// CHECK: warp.atomic_components exch({{.*}}), %arg1
// CHECK: warp.load_lanes unit %arg0
// CHECK: warp.store_lanes unit({{.*}}), %arg1
// CHECK: }
// CHECK: warp.yield
func.func @iterations(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>,
                      %n: i32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  scf.for %k = %c0 to %n step %c1 : i32 {
    %a = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
    %old = warp.atomic_components exch(%a), %y[%i]
      : (f32), !warp.array<1 x f32>, i32 -> f32
    %b = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
    %s = arith.addf %b, %old : f32
    warp.store_components(%s), %y[%i] : (f32), !warp.array<1 x f32>, i32
  }
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 3, non_negative = 4,
      disjoint = true, thread_order = true, lanes = 4>

// Who takes a gradient first shows. Each thread takes one, and nothing else
// sees it, so lanes do it one after the other.
// CHECK-LABEL: func.func @winner
// CHECK: %[[GRAD:.*]] = warp.grad %arg1
// CHECK: warp.each_lane
// CHECK: warp.atomic_components exch({{.*}}), %[[GRAD]]
func.func @winner(%x: !warp.array<1 x f32>, %best: !warp.array<1 x f32>,
                  %at: !warp.array<1 x si32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %none = arith.constant 0.0 : f32
  %gradient = warp.grad %best : !warp.array<1 x f32> -> !warp.array<1 x f32>
  %k = warp.load_components %at[%i] : !warp.array<1 x si32>, i32 -> i32
  %g = warp.atomic_components exch(%none), %gradient[%k] : (f32), !warp.array<1 x f32>, i32 -> f32
  %e = math.exp %g : f32
  warp.store_components(%e), %x[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 3, non_negative = 4,
      disjoint = true, thread_order = true, lanes = 4>

// A gradient that is read by another name may be that of a thread before.
// CHECK-LABEL: func.func @seen
// CHECK-NOT: warp.each_lane
func.func @seen(%x: !warp.array<1 x f32>, %best: !warp.array<1 x f32>,
                %at: !warp.array<1 x si32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %none = arith.constant 0.0 : f32
  %gradient = warp.grad %best : !warp.array<1 x f32> -> !warp.array<1 x f32>
  %again = warp.grad %best : !warp.array<1 x f32> -> !warp.array<1 x f32>
  %k = warp.load_components %at[%i] : !warp.array<1 x si32>, i32 -> i32
  %g = warp.atomic_components exch(%none), %gradient[%k] : (f32), !warp.array<1 x f32>, i32 -> f32
  %h = warp.load_components %again[%i] : !warp.array<1 x f32>, i32 -> f32
  %e = arith.addf %g, %h : f32
  warp.store_components(%e), %x[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

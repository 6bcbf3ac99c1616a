// RUN: warp-opt %s --split-input-file --warp-pipeline="to-gpu packed=3 large target=sm_90" \
// RUN:   | FileCheck %s
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-gpu packed=3 target=sm_90" \
// RUN:   | FileCheck %s --check-prefix=SMALL
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-gpu packed=3 large debug target=sm_90" \
// RUN:   | FileCheck %s --check-prefix=SMALL

// Blocks count from the last on if the header says so.
// CHECK-LABEL: gpu.func @stream
// CHECK-SAME: reverse_order = true
// CHECK: %[[ID:.*]] = gpu.block_id x
// CHECK: %[[FIRST:.*]] = arith.index_cast %[[ID]]
// CHECK: %[[GRID:.*]] = gpu.grid_dim x
// CHECK: %[[COUNT:.*]] = arith.index_cast %[[GRID]]
// CHECK: %[[END:.*]] = arith.subi %[[COUNT]],
// CHECK: %[[LAST:.*]] = arith.subi %[[END]], %[[FIRST]]
// CHECK: llvm.getelementptr inbounds %arg0[16]
// CHECK: %[[ORDER:.*]] = llvm.load
// CHECK: %[[IS_LAST:.*]] = arith.cmpi ne, %[[ORDER]],
// CHECK: arith.select %[[IS_LAST]], %[[LAST]], %[[FIRST]]
// SMALL-LABEL: gpu.func @stream
// SMALL-NOT: reverse_order
// SMALL-NOT: gpu.grid_dim
// SMALL-LABEL: gpu.func @scatter
func.func @stream(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %a = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  warp.store %a, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// Sums of floats are rounded in the order of threads.
// CHECK-LABEL: gpu.func @scatter
// CHECK-NOT: reverse_order
// CHECK-NOT: gpu.grid_dim
func.func @scatter(%n: !warp.array<1 x si32>, %y: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %one = warp.constant 1.0 : f32
  %at = warp.load %n[%i] : !warp.array<1 x si32>, si32 -> si32
  %old = warp.atomic add %one, %y[%at] : f32, !warp.array<1 x f32>, si32 -> f32
  return
}

// -----

// Updates of integers, and the least of some floats, are not.
// CHECK-LABEL: gpu.func @count
// CHECK-SAME: reverse_order = true
func.func @count(%n: !warp.array<1 x si32>, %y: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %one = warp.constant 1 : si32
  %at = warp.load %n[%i] : !warp.array<1 x si32>, si32 -> si32
  %x = warp.load %y[%i] : !warp.array<1 x f32>, si32 -> f32
  %old = warp.atomic add %one, %n[%at] : si32, !warp.array<1 x si32>, si32 -> si32
  %least = warp.atomic min %x, %y[%at] : f32, !warp.array<1 x f32>, si32 -> f32
  return
}

// -----

// The result of a counter numbers things.
// CHECK-LABEL: gpu.func @number
// CHECK-NOT: reverse_order
// CHECK-NOT: gpu.grid_dim
func.func @number(%n: !warp.array<1 x si32>, %y: !warp.array<1 x si32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %zero = warp.constant 0 : si32
  %one = warp.constant 1 : si32
  %old = warp.atomic add %one, %n[%zero] : si32, !warp.array<1 x si32>, si32 -> si32
  warp.store %i, %y[%old] : si32, !warp.array<1 x si32>, si32
  return
}

// -----

// Threads with more to do may be the first ones.
// CHECK-LABEL: gpu.func @uneven
// CHECK-NOT: reverse_order
// CHECK-NOT: gpu.grid_dim
func.func @uneven(%n: !warp.array<1 x si32>, %y: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %zero = warp.constant 0.0 : f32
  %count = warp.load %n[%i] : !warp.array<1 x si32>, si32 -> si32
  %end = warp.cast %count : si32 to i32
  %sum = scf.for %k = %c0 to %end step %c1 iter_args(%s = %zero) -> (f32) : i32 {
    %j = warp.cast %k : i32 to si32
    %a = warp.load %y[%j] : !warp.array<1 x f32>, si32 -> f32
    %t = warp.add(%s, %a) : (f32, f32) -> f32
    scf.yield %t : f32
  }
  warp.store %sum, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// All go through the same number of elements.
// CHECK-LABEL: gpu.func @even
// CHECK-SAME: reverse_order = true
func.func @even(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: si32) attributes {warp.kernel} {
  %i = warp.tid : si32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %zero = warp.constant 0.0 : f32
  %first = warp.mul(%i, %n) : (si32, si32) -> si32
  %end = warp.cast %n : si32 to i32
  %sum = scf.for %k = %c0 to %end step %c1 iter_args(%s = %zero) -> (f32) : i32 {
    %j = warp.cast %k : i32 to si32
    %at = warp.add(%first, %j) : (si32, si32) -> si32
    %a = warp.load %x[%at] : !warp.array<1 x f32>, si32 -> f32
    %t = warp.mul(%s, %a) : (f32, f32) -> f32
    %u = warp.add(%t, %a) : (f32, f32) -> f32
    scf.yield %u : f32
  }
  warp.store %sum, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// RUN: warp-opt %s --split-input-file --warp-form-launch --warp-plan-updates --warp-apply-schedules --warp-emit-entry --warp-apply-schedules=stage=updates \
// RUN:   | FileCheck %s

#gpu = #warp.variant<target = <name = "sm_90">>

// Lanes of a whole warp begin a tile at different iterations; the sum of one
// goes to the lane before, and each lane updates the element that it ends with.
// The loop as it was follows.
// CHECK-LABEL: llvm.func ptx_kernelcc @pairs
// CHECK: %[[SLOT:.*]] = llvm.alloca {{.*}} x f32
// CHECK: %[[LANE_INDEX:.*]] = gpu.lane_id
// CHECK: %[[LANE:.*]] = arith.index_cast %[[LANE_INDEX]] : index to i32
// CHECK: %[[NEXT:.*]] = arith.addi %[[LANE]], %c1_i32
// CHECK: %[[TRIPS:.*]] = arith.subi %[[N:.*]], %[[FIRST:.*]] : i32
// CHECK: %[[FULL:.*]] = arith.andi %[[TRIPS]], %c-32_i32
// CHECK: "llvm.nvvm.activemask"
// CHECK: %[[OF_TILES:.*]] = arith.select %{{.*}}, %[[FULL]], %c0_i32
// CHECK: %[[END:.*]] = arith.addi %[[FIRST]], %[[OF_TILES]] {warp.non_negative}
// CHECK: scf.for %[[TILE:.*]] = %[[FIRST]] to %[[END]] step %c32_i32
// CHECK: llvm.store %cst{{.*}}, %[[SLOT]]
// CHECK: scf.for %[[STEP:.*]] = %c0_i32{{.*}} to %c32_i32{{.*}} step %c1_i32
// CHECK: %[[TURN:.*]] = arith.addi %[[LANE]], %[[STEP]]
// CHECK: %[[OFFSET:.*]] = arith.andi %[[TURN]], %c31_i32
// CHECK: %[[J:.*]] = arith.addi %[[TILE]], %[[OFFSET]]
// CHECK: warp.load_components %{{.*}}[%[[J]]]
// CHECK-NOT: warp.atomic_components
// CHECK: arith.addf {{.*}} fastmath<reassoc> : f32
// CHECK: %[[SUM:.*]], %{{.*}} = gpu.shuffle idx %{{.*}}, %[[NEXT]], %{{.*}} : f32
// CHECK: llvm.store %[[SUM]], %[[SLOT]]
// CHECK: }
// CHECK: %[[MINE:.*]] = arith.addi %[[TILE]], %[[LANE]]
// CHECK: %[[TOTAL:.*]] = llvm.load %[[SLOT]]
// CHECK: warp.atomic_components add(%[[TOTAL]]), %{{.*}}[%[[MINE]]]
// CHECK: scf.for %[[K:.*]] = %[[END]] to %[[N]] step
// CHECK-NOT: gpu.shuffle
// CHECK: warp.atomic_components add({{.*}}), %{{.*}}[%[[K]]]
func.func @pairs(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : i32
  %xi = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  scf.for %j = %c0 to %n step %c1 : i32 {
    %xj = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
    %v = arith.subf %xi, %xj : f32
    %old = warp.atomic_components add(%v), %y[%j]
      : (f32), !warp.array<1 x f32>, i32 -> f32
  }
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">>

// An update that iterations may leave out: a bit says which did not, and an
// element that none reached is left alone, as the array may end before it.
// CHECK-LABEL: llvm.func ptx_kernelcc @guarded
// CHECK: scf.for
// CHECK: scf.for
// CHECK: scf.if
// CHECK: arith.subf {{.*}} fastmath<reassoc>
// CHECK: %[[BIT:.*]] = arith.shli %c1_i32{{.*}}, %[[OFFSET:.*]] : i32
// CHECK: %[[BITS:.*]] = arith.ori %{{.*}}, %[[BIT]]
// CHECK: llvm.store %[[BITS]], %[[REACHED:.*]] : i32
// CHECK: }
// CHECK: gpu.shuffle idx
// CHECK: }
// CHECK: llvm.load %[[REACHED]]
// CHECK-COUNT-5: gpu.shuffle xor
// CHECK: scf.if
// CHECK: %[[MINE:.*]] = arith.muli
// CHECK: warp.atomic_components add({{.*}}), %{{.*}}[%[[MINE]]]
func.func @guarded(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %c3 = arith.constant 3 : i32
  %zero = arith.constant 0.0 : f32
  scf.for %j = %c0 to %n step %c1 : i32 {
    %xj = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
    %positive = arith.cmpf ogt, %xj, %zero : f32
    scf.if %positive {
      %at = arith.muli %j, %c3 : i32
      %old = warp.atomic_components sub(%xj), %y[%at]
        : (f32), !warp.array<1 x f32>, i32 -> f32
    }
  }
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">>

// Sums whose order is open are carried along, on every path; 64 bits take two
// shuffles.
// CHECK-LABEL: llvm.func ptx_kernelcc @sums
// CHECK: %[[OF_TILES:.*]]:2 = scf.for {{.*}} -> (f64, i64)
// CHECK: %[[OF_STEPS:.*]]:2 = scf.for {{.*}} -> (f64, i64)
// CHECK-COUNT-2: gpu.shuffle idx {{.*}} : i32
// CHECK-NOT: gpu.shuffle
// CHECK: scf.yield %[[OF_STEPS]]#0, %[[OF_STEPS]]#1
// CHECK: scf.for {{.*}} iter_args(
// CHECK-SAME: %{{.*}} = %[[OF_TILES]]#0, %{{.*}} = %[[OF_TILES]]#1)
func.func @sums(%x: !warp.array<1 x f64>, %y: !warp.array<1 x f64>, %n: i32,
                %z: !warp.array<1 x f64>, %k: !warp.array<1 x si64>)
    attributes {warp.kernel, warp.variant = #gpu} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %zero = arith.constant 0.0 : f64
  %none = arith.constant 0 : i64
  %one = arith.constant 1 : i64
  %i = warp.tid : i32
  %r:2 = scf.for %j = %c0 to %n step %c1 iter_args(%s = %zero, %m = %none)
      -> (f64, i64) : i32 {
    %v = warp.load_components %x[%j] : !warp.array<1 x f64>, i32 -> f64
    %old = warp.atomic_components add(%v), %y[%j]
      : (f64), !warp.array<1 x f64>, i32 -> f64
    %positive = arith.cmpf ogt, %v, %zero : f64
    %t, %u = scf.if %positive -> (f64, i64) {
      %a = arith.addf %s, %v fastmath<reassoc> : f64
      %b = arith.addi %one, %m : i64
      scf.yield %a, %b : f64, i64
    } else {
      scf.yield %s, %m : f64, i64
    }
    scf.yield %t, %u : f64, i64
  }
  warp.store_components(%r#0), %z[%i] : (f64), !warp.array<1 x f64>, i32
  warp.store_components(%r#1), %k[%i] : (i64), !warp.array<1 x si64>, i32
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">>

// A value that depends on the counter of an outer loop is the same for all
// lanes if they agree on that counter.
// CHECK-LABEL: llvm.func ptx_kernelcc @rows
// CHECK: scf.for %[[ROW:.*]] =
// CHECK: "llvm.nvvm.activemask"
// CHECK: scf.if
// CHECK: gpu.shuffle idx %[[ROW]], %c0_i32{{.*}}, %{{.*}} : i32
// CHECK: "llvm.nvvm.vote.all.sync"
// CHECK: scf.for %[[TILE:.*]] =
// CHECK: scf.for
// CHECK: gpu.shuffle idx
// CHECK: %[[MINE:.*]] = arith.addi %[[TILE]]
// CHECK: warp.atomic_components add({{.*}}), %{{.*}}[%[[ROW]], %[[MINE]]]
func.func @rows(%x: !warp.array<1 x si32>, %y: !warp.array<2 x si32>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  scf.for %k = %c0 to %n step %c1 : i32 {
    scf.for %j = %c0 to %n step %c1 : i32 {
      %v = warp.load_components %x[%j] : !warp.array<1 x si32>, i32 -> i32
      %old = warp.atomic_components add(%v), %y[%k, %j]
        : (i32), !warp.array<2 x si32>, i32, i32 -> i32
    }
  }
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">>

// Updates along rows of threads are in lines of their own in any order.
// CHECK-LABEL: llvm.func ptx_kernelcc @rows
// CHECK: scf.for
// CHECK: scf.for
// CHECK: warp.atomic_components add({{.*}}), %{{.*}}[%[[I:.*]], %{{.*}}]
// CHECK: gpu.shuffle idx
// CHECK: warp.atomic_components add({{.*}}), %{{.*}}[%{{[^,]*}}]
// CHECK: scf.for
// CHECK-NOT: gpu.shuffle
func.func @rows(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>,
                %g: !warp.array<2 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : i32
  %xi = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  scf.for %j = %c0 to %n step %c1 : i32 {
    %xj = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
    %v = arith.subf %xi, %xj : f32
    %old = warp.atomic_components add(%v), %y[%j]
      : (f32), !warp.array<1 x f32>, i32 -> f32
    %row = warp.atomic_components add(%xj), %g[%i, %j]
      : (f32), !warp.array<2 x f32>, i32, i32 -> f32
  }
  return
}

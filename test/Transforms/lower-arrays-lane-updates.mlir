// RUN: warp-opt %s --split-input-file --warp-lower-arrays | FileCheck %s

// Live lanes update one after the other, from set bit to set bit of the mask:
// no branch asks each lane.
// CHECK-LABEL: llvm.func @some
// CHECK: %[[BITS:.*]] = llvm.bitcast %arg3 : vector<4xi1> to i4
// CHECK: %[[ALL:.*]] = arith.extui %[[BITS]] : i4 to i64
// CHECK: scf.while (%{{.*}} = %[[ALL]])
// CHECK: %[[LANE:.*]] = "llvm.intr.cttz"
// CHECK-NOT: scf.if
// CHECK: llvm.getelementptr %{{.*}}[%[[LANE]]]
// CHECK: llvm.atomicrmw fadd
// CHECK: scf.yield
// CHECK: llvm.return
llvm.func @some(%block: !llvm.ptr, %i: vector<4xi32>, %v: vector<4xf32>,
                %m: vector<4xi1>) attributes {warp.entry} {
  %a = warp.parameter %block[24] packed : !llvm.ptr -> !warp.array<1 x f32>
  warp.update_lanes add(%v), %a[%i] mask %m {nonNegative = array<i1: true>}
    : (vector<4xf32>), !warp.array<1 x f32>, (vector<4xi32>), vector<4xi1>
  llvm.return
}

// -----

// With all lanes live the loop has a known number of trips.
// CHECK-LABEL: llvm.func @all
// CHECK-NOT: cttz
// CHECK: scf.for
// CHECK: llvm.atomicrmw fadd
// CHECK: llvm.return
llvm.func @all(%block: !llvm.ptr, %i: vector<4xi32>, %v: vector<4xf32>)
    attributes {warp.entry} {
  %m = arith.constant dense<true> : vector<4xi1>
  %a = warp.parameter %block[24] packed : !llvm.ptr -> !warp.array<1 x f32>
  warp.update_lanes add(%v), %a[%i] mask %m {nonNegative = array<i1: true>}
    : (vector<4xf32>), !warp.array<1 x f32>, (vector<4xi32>), vector<4xi1>
  llvm.return
}

// -----

// Code that runs alone updates elements of several numbers as rows: lane n
// finds its row in vector n % 4. Where all lanes are live, four at a time.
// CHECK-LABEL: llvm.func @rows
// CHECK: %[[IS_ALL:.*]] = "llvm.intr.vector.reduce.and"(%arg3)
// CHECK: scf.if %[[IS_ALL]] {
// CHECK: scf.for
// CHECK-COUNT-4: arith.addf %{{.*}} : vector<2xf32>
// CHECK: } else {
// CHECK: scf.while
// CHECK: %[[LANE:.*]] = "llvm.intr.cttz"
// CHECK-DAG: %[[K:.*]] = arith.remui %[[LANE]], %{{.*}} : i64
// CHECK-DAG: %[[SQUARE:.*]] = arith.divui %[[LANE]], %{{.*}} : i64
// CHECK: %[[FIRST:.*]] = arith.muli %[[K]], %{{.*}} : i64
// CHECK: %[[PLACE:.*]] = arith.addi %[[FIRST]], %[[SQUARE]] : i64
// CHECK: %[[AT:.*]] = llvm.getelementptr %{{.*}}[%[[PLACE]]] : {{.*}} vector<4xf32>
// CHECK: llvm.load %[[AT]] : !llvm.ptr -> vector<4xf32>
// CHECK: arith.addf %{{.*}} : vector<2xf32>
// CHECK: arith.addf %{{.*}} : f32
// CHECK: llvm.return
llvm.func @rows(%block: !llvm.ptr, %i: vector<8xi32>, %v: vector<8xf32>,
                %m: vector<8xi1>)
    attributes {warp.entry, warp.schedule = #warp.schedule<exclusive = true>} {
  %a = warp.parameter %block[24] packed
    : !llvm.ptr -> !warp.array<1 x !warp.vec<3 x f32>>
  warp.update_lanes add(%v, %v, %v), %a[%i] mask %m
    {nonNegative = array<i1: true>}
    : (vector<8xf32>, vector<8xf32>, vector<8xf32>),
      !warp.array<1 x !warp.vec<3 x f32>>, (vector<8xi32>), vector<8xi1>
  llvm.return
}

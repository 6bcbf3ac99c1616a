// RUN: warp-opt %s --split-input-file --warp-lower-lanes | FileCheck %s

// A mask has a lane if its bits have one; a value is spread by a shuffle; lane
// numbers are a constant.
// CHECK-LABEL: llvm.func @values
// CHECK-DAG: %[[NUMBERS:.*]] = arith.constant dense<[0, 1, 2, 3]> : vector<4xi32>
// CHECK-DAG: %[[ONE:.*]] = llvm.insertelement %arg0, %{{.*}} : vector<4xi32>
// CHECK: %[[ALL:.*]] = llvm.shufflevector %[[ONE]], %{{.*}} [0, 0, 0, 0]
// CHECK: %[[LESS:.*]] = arith.cmpi slt, %[[NUMBERS]], %[[ALL]]
// CHECK: "llvm.intr.vector.reduce.or"(%[[LESS]]) : (vector<4xi1>) -> i1
llvm.func @values(%n: i32) -> i1 attributes {warp.entry} {
  %numbers = warp.lane_numbers : vector<4xi32>
  %all = warp.broadcast %n : i32 -> vector<4xi32>
  %less = arith.cmpi slt, %numbers, %all : vector<4xi32>
  %any = warp.any %less : vector<4xi1>
  llvm.return %any : i1
}

// -----

// Halves are combined first, by the kind and the sign of the numbers.
// CHECK-LABEL: llvm.func @combine
// CHECK: %[[LOW:.*]] = llvm.shufflevector %arg0, %arg0 [0, 1]
// CHECK: %[[HIGH:.*]] = llvm.shufflevector %arg0, %arg0 [2, 3]
// CHECK: %[[HALF:.*]] = arith.maxui %[[LOW]], %[[HIGH]] : vector<2xi32>
// CHECK: llvm.shufflevector %[[HALF]], %[[HALF]] [0]
// CHECK: llvm.shufflevector %[[HALF]], %[[HALF]] [1]
// CHECK: %[[LAST:.*]] = arith.maxui {{.*}} : vector<1xi32>
// CHECK: %[[MOST:.*]] = llvm.extractelement %[[LAST]]
// CHECK: llvm.return %[[MOST]]
llvm.func @combine(%v: vector<4xi32>, %m: vector<4xi1>) -> i32
    attributes {warp.entry} {
  %any = warp.any %m : vector<4xi1>
  %most = warp.combine_lanes %v {kind = 3 : i32, type = ui32}
    : vector<4xi32> -> i32
  llvm.return %most : i32
}

// -----

// In the copy for full vectors the mask is a constant: nothing asks it.
// CHECK-LABEL: llvm.func @full
// CHECK-NOT: scf.if
// CHECK-NOT: vector.reduce.or
// CHECK: llvm.return
llvm.func @full(%v: vector<4xf32>) -> vector<4xf32> attributes {warp.entry} {
  %all = arith.constant dense<true> : vector<4xi1>
  %any = warp.any %all : vector<4xi1>
  %r = scf.if %any -> vector<4xf32> {
    %s = arith.addf %v, %v : vector<4xf32>
    scf.yield %s : vector<4xf32>
  } else {
    scf.yield %v : vector<4xf32>
  }
  llvm.return %r : vector<4xf32>
}

// -----

// What lanes do one by one is a loop over those that the mask has. Operands and
// results go through memory, booleans as bytes.
// CHECK-LABEL: llvm.func @each
// CHECK-DAG: %[[IN:.*]] = llvm.alloca %{{.*}} x vector<4xf32>
// CHECK-DAG: %[[OUT:.*]] = llvm.alloca %{{.*}} x vector<4xf32>
// CHECK-DAG: %[[MASK:.*]] = llvm.alloca %{{.*}} x vector<4xi8>
// CHECK-DAG: llvm.store %arg1, %{{.*}} : vector<4xf32>, !llvm.ptr
// CHECK-DAG: %[[BYTES:.*]] = arith.extui %arg0 : vector<4xi1> to vector<4xi8>
// CHECK-DAG: llvm.store %[[BYTES]], %[[MASK]]
// CHECK: scf.for %[[LANE:.*]] = %{{.*}} to %{{.*}} step %{{.*}} : i32 {
// CHECK: %[[BIT:.*]] = llvm.getelementptr %[[MASK]][%[[LANE]]]
// CHECK: %[[BYTE:.*]] = llvm.load %[[BIT]] : !llvm.ptr -> i8
// CHECK: %[[IS:.*]] = arith.trunci %[[BYTE]] : i8 to i1
// CHECK: scf.if %[[IS]] {
// CHECK: %[[ONE:.*]] = llvm.load %{{.*}} : !llvm.ptr -> f32
// CHECK: %[[TWICE:.*]] = arith.addf %[[ONE]], %[[ONE]] : f32
// CHECK: llvm.store %[[TWICE]], %{{.*}} : f32
// CHECK: %[[R:.*]] = llvm.load %{{.*}} : !llvm.ptr -> vector<4xf32>
// CHECK: llvm.return %[[R]]
llvm.func @each(%m: vector<4xi1>, %v: vector<4xf32>) -> vector<4xf32>
    attributes {warp.entry} {
  %any = warp.any %m : vector<4xi1>
  %r = warp.each_lane %m (%v) {
  ^bb0(%x: f32):
    %y = arith.addf %x, %x : f32
    warp.yield %y : f32
  } : vector<4xi1>, vector<4xf32> -> vector<4xf32>
  llvm.return %r : vector<4xf32>
}

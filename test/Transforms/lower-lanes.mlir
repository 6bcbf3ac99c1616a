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

// An operation without a vector form is a loop over the set bits of the mask,
// from the lowest on, without a branch for each lane. Operands and results go
// through memory.
// CHECK-LABEL: llvm.func @each
// CHECK: %[[OUT:.*]] = llvm.alloca %{{.*}} x vector<4xf32>
// CHECK: llvm.store %arg1, %[[IN:.*]] : vector<4xf32>, !llvm.ptr
// CHECK: %[[BITS:.*]] = llvm.bitcast %arg0 : vector<4xi1> to i4
// CHECK: %[[ALL:.*]] = arith.extui %[[BITS]] : i4 to i64
// CHECK: scf.while (%[[LEFT:.*]] = %[[ALL]])
// CHECK: %[[ANY:.*]] = arith.cmpi ne, %[[LEFT]]
// CHECK: scf.condition(%[[ANY]]) %[[LEFT]]
// CHECK: ^bb0(%[[NOW:.*]]: i64):
// CHECK: %[[LANE:.*]] = "llvm.intr.cttz"(%[[NOW]])
// CHECK: %[[AT:.*]] = llvm.getelementptr %[[IN]][%[[LANE]]]
// CHECK: %[[ONE:.*]] = llvm.load %[[AT]] : !llvm.ptr -> f32
// CHECK-NOT: scf.if
// CHECK: %[[TWICE:.*]] = arith.addf %[[ONE]], %[[ONE]] : f32
// CHECK: %[[TO:.*]] = llvm.getelementptr %[[OUT]][%[[LANE]]]
// CHECK: llvm.store %[[TWICE]], %[[TO]] : f32
// CHECK: %[[LOWER:.*]] = arith.subi %[[NOW]]
// CHECK: %[[NEXT:.*]] = arith.andi %[[NOW]], %[[LOWER]]
// CHECK: scf.yield %[[NEXT]]
// CHECK: %[[R:.*]] = llvm.load %[[OUT]] : !llvm.ptr -> vector<4xf32>
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

// -----

// With all lanes live the loop has a known number of trips.
// CHECK-LABEL: llvm.func @each_of_all
// CHECK-NOT: cttz
// CHECK: scf.for
// CHECK: arith.addf
// CHECK: llvm.return
llvm.func @each_of_all(%v: vector<4xf32>) -> vector<4xf32>
    attributes {warp.entry} {
  %all = arith.constant dense<true> : vector<4xi1>
  %any = warp.any %all : vector<4xi1>
  %r = warp.each_lane %all (%v) {
  ^bb0(%x: f32):
    %y = arith.addf %x, %x : f32
    warp.yield %y : f32
  } : vector<4xi1>, vector<4xf32> -> vector<4xf32>
  llvm.return %r : vector<4xf32>
}

// -----

// Lanes that take numbers from a counter make one update by the sum of theirs;
// sums over the lanes before each say what it would have seen.
// CHECK-LABEL: llvm.func @counter
// CHECK-NOT: scf.while
// CHECK: %[[TERMS:.*]] = arith.select %arg0, %arg1, %[[NONE:.*]] :
// CHECK: %[[ONE:.*]] = llvm.shufflevector %[[NONE]], %[[TERMS]] [3, 4, 5, 6]
// CHECK: %[[PAIRS:.*]] = arith.addi %[[TERMS]], %[[ONE]]
// CHECK: %[[TWO:.*]] = llvm.shufflevector %[[NONE]], %[[PAIRS]] [2, 3, 4, 5]
// CHECK: %[[SUMS:.*]] = arith.addi %[[PAIRS]], %[[TWO]]
// CHECK: %[[TOTAL:.*]] = llvm.extractelement %[[SUMS]]
// CHECK: %[[OLD:.*]] = warp.atomic_components add(%[[TOTAL]])
// CHECK: %[[AT_FIRST:.*]] = llvm.insertelement %[[OLD]]
// CHECK: %[[BASE:.*]] = llvm.shufflevector %[[AT_FIRST]], {{.*}} [0, 0, 0, 0]
// CHECK: %[[BEFORE:.*]] = arith.subi %[[SUMS]], %[[TERMS]]
// CHECK: %[[EACH:.*]] = arith.addi %[[BASE]], %[[BEFORE]]
// CHECK: llvm.return %[[EACH]]
llvm.func @counter(%m: vector<4xi1>, %v: vector<4xi32>, %block: !llvm.ptr)
    -> vector<4xi32> attributes {warp.entry} {
  %c0 = arith.constant 0 : i32
  %s = warp.parameter %block[24] packed
    : !llvm.ptr -> !warp.array<1 x si32>
  %any = warp.any %m : vector<4xi1>
  %r = warp.each_lane %m (%v) {
  ^bb0(%x: i32):
    %old = warp.atomic_components add(%x), %s[%c0]
      : (i32), !warp.array<1 x si32>, i32 -> i32
    warp.yield %old : i32
  } : vector<4xi1>, vector<4xi32> -> vector<4xi32>
  llvm.return %r : vector<4xi32>
}

// -----

// Where lanes have counters of their own, or exchange, they are serialised.
// CHECK-LABEL: llvm.func @turns
// CHECK: scf.while
// CHECK: warp.atomic_components add
// CHECK: scf.while
// CHECK: warp.atomic_components exch
llvm.func @turns(%m: vector<4xi1>, %at: vector<4xi32>, %block: !llvm.ptr)
    -> vector<4xi32> attributes {warp.entry} {
  %c0 = arith.constant 0 : i32
  %s = warp.parameter %block[24] packed
    : !llvm.ptr -> !warp.array<1 x si32>
  %any = warp.any %m : vector<4xi1>
  %own = warp.each_lane %m (%at) {
  ^bb0(%i: i32):
    %old = warp.atomic_components add(%i), %s[%i]
      : (i32), !warp.array<1 x si32>, i32 -> i32
    warp.yield %old : i32
  } : vector<4xi1>, vector<4xi32> -> vector<4xi32>
  %swapped = warp.each_lane %m (%at) {
  ^bb0(%i: i32):
    %old = warp.atomic_components exch(%i), %s[%c0]
      : (i32), !warp.array<1 x si32>, i32 -> i32
    warp.yield %old : i32
  } : vector<4xi1>, vector<4xi32> -> vector<4xi32>
  %sum = arith.addi %own, %swapped : vector<4xi32>
  llvm.return %sum : vector<4xi32>
}

// -----

// A branch before the end of a loop's condition becomes part of the body, as
// often as it is forwarded: see WrongRewrites.h.
// CHECK-LABEL: llvm.func @steps
// CHECK: scf.while
// CHECK: scf.condition(%{{.*}}) %[[AT:.*]] : i32
// CHECK: ^bb0(%[[OLD:.*]]: i32):
// CHECK-NEXT: %[[NEXT:.*]] = arith.addi %[[OLD]]
// CHECK-NEXT: scf.yield %[[NEXT]]
llvm.func @steps(%limit: vector<4xi32>, %out: !llvm.ptr) attributes {warp.entry} {
  %zero = arith.constant 0 : i32
  %two = arith.constant 2 : i32
  %other = arith.constant 20 : i32
  %end:3 = scf.while (%at = %zero) : (i32) -> (i32, i32, i32) {
    %all = warp.broadcast %at : i32 -> vector<4xi32>
    %less = arith.cmpi slt, %all, %limit : vector<4xi32>
    %goes = warp.any %less : vector<4xi1>
    %next = scf.if %goes -> (i32) {
      %sum = arith.addi %at, %two : i32
      scf.yield %sum : i32
    } else {
      scf.yield %other : i32
    }
    scf.condition(%goes) %next, %next, %at : i32, i32, i32
  } do {
  ^bb0(%first: i32, %second: i32, %old: i32):
    scf.yield %second : i32
  }
  llvm.store %end#2, %out : i32, !llvm.ptr
  llvm.return
}

// RUN: warp-opt %s --warp-lower-composites | FileCheck %s

// One index in bounds, of a table of one dimension; integers lose their sign.
// CHECK-LABEL: func.func @signed
// CHECK-SAME: %[[I:[^:]*]]: i32, %[[J:[^:]*]]: i64)
// CHECK-DAG: %[[ZERO:.*]] = arith.constant 0 : i32
// CHECK-DAG: %[[ROWS:.*]] = arith.constant 2 : i32
// CHECK-DAG: %[[LASTROW:.*]] = arith.constant 1 : i32
// CHECK: %[[BELOW:.*]] = arith.cmpi slt, %[[I]], %[[ZERO]]
// CHECK: %[[FROMEND:.*]] = arith.addi %[[I]], %[[ROWS]]
// CHECK: %[[ROW:.*]] = arith.select %[[BELOW]], %[[FROMEND]], %[[I]]
// CHECK: %[[R:.*]] = arith.minui %[[ROW]], %[[LASTROW]]
// CHECK: %[[COLUMN:.*]] = arith.minui %{{.*}} : i64
// CHECK: %[[C:.*]] = arith.trunci %[[COLUMN]] : i64 to i32
// CHECK: %[[FIRST:.*]] = arith.muli %[[R]]
// CHECK: %[[PLACE:.*]] = arith.addi %[[FIRST]], %[[C]]
// CHECK: warp.table_get dense<[1, 2, 3, 4, 5, 6]> : tensor<6xi16>[%[[PLACE]]] : i32 -> i16
func.func @signed(%i: si32, %j: si64) -> si16 {
  %x = warp.table_get dense<[[1, 2, 3], [4, 5, 6]]> : tensor<2x3xsi16> [%i, %j] : si32, si64 -> si16
  return %x : si16
}

// An unsigned index is not below zero, and a short one is extended first.
// CHECK-LABEL: func.func @unsigned
// CHECK-SAME: %[[I:[^:]*]]: i8)
// CHECK: %[[WIDE:.*]] = arith.extui %[[I]] : i8 to i32
// CHECK-NOT: arith.cmpi
// CHECK: %[[AT:.*]] = arith.minui %[[WIDE]]
// CHECK: warp.table_get {{.*}}[%[[AT]]] : i32 -> i1
func.func @unsigned(%i: ui8) -> i1 {
  %x = warp.table_get dense<[true, false, true]> : tensor<3xi1> [%i] : ui8 -> i1
  return %x : i1
}

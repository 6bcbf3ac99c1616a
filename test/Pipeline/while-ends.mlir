// The final value of a loop is the one that the branch yields then; the value
// that it takes from the condition is forwarded.
//
// RUN: warp-opt %s --warp-emit=thread | FileCheck %s

// CHECK-LABEL: func.func @ends
// CHECK: %[[END:.*]]:2 = scf.while (%[[AT:.*]] = %c1_i32)
// CHECK: %[[SQUARE:.*]] = arith.muli %[[AT]], %[[AT]]
// CHECK: scf.condition(%{{.*}}) %[[AT]], %[[SQUARE]]
// CHECK: ^bb0(%[[OLD:.*]]: i32, %[[TAKEN:.*]]: i32):
// CHECK-NEXT: %[[SUM:.*]] = arith.addi %[[OLD]], %[[TAKEN]]
// CHECK-NEXT: scf.yield %[[SUM]]
// CHECK: arith.addi %[[END]]#0, %c20_i32
func.func @ends(%out: !warp.array<1 x si32>, %n: si32) attributes {warp.kernel} {
  %zero = warp.constant 0 : si32
  %one = warp.constant 1 : si32
  %other = warp.constant 20 : si32
  %end:2 = scf.while (%at = %one) : (si32) -> (si32, si32) {
    %square = warp.mul(%at, %at) : (si32, si32) -> si32
    %goes = warp.lt(%square, %n) : (si32, si32) -> i1
    %next = scf.if %goes -> (si32) {
      %sum = warp.add(%at, %square) : (si32, si32) -> si32
      scf.yield %sum : si32
    } else {
      scf.yield %other : si32
    }
    scf.condition(%goes) %next, %at : si32, si32
  } do {
  ^bb0(%next: si32, %old: si32):
    scf.yield %next : si32
  }
  %sum = warp.add(%end#0, %end#1) : (si32, si32) -> si32
  warp.store %sum, %out[%zero] : si32, !warp.array<1 x si32>, si32
  return
}

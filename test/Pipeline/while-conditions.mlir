// A branch before the end of a loop's condition becomes part of the body, which
// has what it gives where the loop goes on, though it is forwarded twice: LLVM
// 22 would give the body what the branch yields when the loop ends.
//
// RUN: warp-opt %s --warp-emit=thread | FileCheck %s

// CHECK-LABEL: func.func @steps
// CHECK: %[[END:.*]] = scf.while (%[[AT:.*]] = %c0_i32)
// CHECK-NEXT: %[[GOES:.*]] = arith.cmpi slt, %[[AT]]
// CHECK-NEXT: scf.condition(%[[GOES]]) %[[AT]]
// CHECK: ^bb0(%[[OLD:.*]]: i32):
// CHECK-NEXT: %[[NEXT:.*]] = arith.addi %[[OLD]], %c2_i32
// CHECK-NEXT: scf.yield %[[NEXT]]
// CHECK: warp.store_components(%[[END]])
func.func @steps(%out: !warp.array<1 x si32>, %n: si32) attributes {warp.kernel} {
  %zero = warp.constant 0 : si32
  %two = warp.constant 2 : si32
  %other = warp.constant 20 : si32
  %end:3 = scf.while (%at = %zero) : (si32) -> (si32, si32, si32) {
    %goes = warp.lt(%at, %n) : (si32, si32) -> i1
    %next = scf.if %goes -> (si32) {
      %sum = warp.add(%at, %two) : (si32, si32) -> si32
      scf.yield %sum : si32
    } else {
      scf.yield %other : si32
    }
    scf.condition(%goes) %next, %next, %at : si32, si32, si32
  } do {
  ^bb0(%first: si32, %second: si32, %old: si32):
    scf.yield %second : si32
  }
  warp.store %end#2, %out[%zero] : si32, !warp.array<1 x si32>, si32
  return
}

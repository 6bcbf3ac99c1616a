// A branch before the end of a loop's condition, one result of which is handed
// on twice, stays there: LLVM 22 would give the body what the branch yields when
// the loop ends.
//
// RUN: warp-opt %s --warp-emit=thread | FileCheck %s

// CHECK-LABEL: func.func @steps
// CHECK: scf.while
// CHECK: %[[GOES:.*]] = arith.cmpi slt
// CHECK: %[[NEXT:.*]] = {{scf.if|arith.select}} %[[GOES]]
// CHECK: scf.condition(%[[GOES]]) {{.*}}%[[NEXT]]
// CHECK: ^bb0(
// CHECK-NOT: scf.yield %c20
// CHECK: warp.store_components
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

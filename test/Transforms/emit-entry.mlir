// RUN: warp-opt %s --split-input-file --warp-form-launch --warp-emit-entry | FileCheck %s

#cpu = #warp.variant<target = <name = "cpu", bits = 128>, packed = 1>

// A launch of rank 1 is one loop; arguments are read before.
// CHECK-LABEL: llvm.func @line
// CHECK-SAME: (%[[BLOCK:.*]]: !llvm.ptr {llvm.noalias, llvm.readonly}, %[[BEGIN:.*]]: i64, %[[END:.*]]: i64)
// CHECK-SAME: warp.entry
// CHECK: %[[A:.*]] = warp.parameter %[[BLOCK]][24] packed {name = "a"} : !llvm.ptr -> !warp.array<1 x f32>
// CHECK: %[[S:.*]] = warp.parameter %[[BLOCK]][80] {name = "s"} : !llvm.ptr -> f32
// CHECK: ^bb1:
// CHECK-NEXT: %[[ONE:.*]] = arith.constant 1 : i64
// CHECK-NEXT: scf.for %[[INDEX:.*]] = %[[BEGIN]] to %[[END]] step %[[ONE]] : i64 {
// CHECK-NEXT: %[[I:.*]] = arith.trunci %[[INDEX]] overflow<nsw, nuw> : i64 to i32
// CHECK-NEXT: warp.store_components(%[[S]]), %[[A]][%[[I]]]
// CHECK-NEXT: }
// CHECK: llvm.return
func.func @line(%a: !warp.array<1 x f32>, %s: f32) attributes {
    warp.kernel, warp.arg_names = ["a", "s"], warp.variant = #cpu} {
  %i = warp.tid : i32
  warp.store_components(%s), %a[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 128>, rank = 3>

// Rank 3 walks rows: two divisions find the first and the last row, one per
// row finds its indices, and none is in the inner loop.
// CHECK-LABEL: llvm.func @rows
// CHECK-SAME: %[[BEGIN:[^ ]+]]: i64, %[[END:[^ ]+]]: i64)
// CHECK: %[[ROWS:.*]] = warp.parameter %{{.*}}[4] : !llvm.ptr -> i32
// CHECK: %[[ANY:.*]] = arith.cmpi slt, %[[BEGIN]], %[[END]]
// CHECK: scf.if %[[ANY]] {
// CHECK-COUNT-2: arith.divui
// CHECK-NOT: arith.divui
// CHECK: scf.for %[[ROW:.*]] = %[[FIRST:.*]] to
// CHECK: %[[IS_FIRST:.*]] = arith.cmpi eq, %[[ROW]], %[[FIRST]]
// CHECK: %[[FROM:.*]] = arith.select %[[IS_FIRST]]
// CHECK: %[[TO:.*]] = arith.select
// CHECK: %[[I:.*]] = arith.divui %{{.*}}, %[[ROWS]]
// CHECK: %[[J:.*]] = arith.subi
// CHECK-NOT: arith.divui
// CHECK: scf.for %[[COLUMN:.*]] = %[[FROM]] to %[[TO]] step
// CHECK-NEXT: %[[K:.*]] = arith.trunci %[[COLUMN]]
// CHECK-NEXT: warp.store_components({{.*}}), %{{.*}}[%[[I]], %[[J]], %[[K]]]
// CHECK-NOT: arith.divui
// CHECK: llvm.return
func.func @rows(%a: !warp.array<3 x f32>, %s: f32) attributes {
    warp.kernel, warp.variant = #cpu} {
  %i, %j, %k = warp.tid : i32, i32, i32
  warp.store_components(%s), %a[%i, %j, %k]
    : (f32), !warp.array<3 x f32>, i32, i32, i32
  return
}

// -----

// Struct and vector arguments are read leaf by leaf from their C layout.
// CHECK-LABEL: llvm.func @layout
// CHECK-SAME: %[[BLOCK:[a-z0-9]+]]: !llvm.ptr
// CHECK: warp.parameter %[[BLOCK]][24] {name = "b"} : !llvm.ptr -> i1
// CHECK: warp.parameter %[[BLOCK]][28] {name = "v"} : !llvm.ptr -> f32
// CHECK: warp.parameter %[[BLOCK]][32] {name = "v"} : !llvm.ptr -> f32
// CHECK: warp.parameter %[[BLOCK]][40] {name = "s.a"} : !llvm.ptr -> !warp.array<1 x f32>
// CHECK: warp.parameter %[[BLOCK]][96] {name = "s.n"} : !llvm.ptr -> i64
func.func @layout(%b: i1, %x: f32, %y: f32, %a: !warp.array<1 x f32>, %n: i64)
    attributes {warp.kernel,
      warp.arg_names = ["b", "v", "s"], warp.arg_types = [i1,
      !warp.vec<2 x f32>,
        !warp.struct<"S", {a: !warp.array<1 x f32>, n: si64}>]} {
  return
}

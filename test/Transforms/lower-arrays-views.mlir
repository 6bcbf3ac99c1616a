// RUN: warp-opt %s --split-input-file --warp-lower-arrays | FileCheck %s

// A row of a packed matrix of numbers is packed: no stride is computed.
// CHECK-LABEL: llvm.func @row
// CHECK: arith.muli
// CHECK: %[[ROW:.*]] = llvm.getelementptr inbounds
// CHECK: llvm.getelementptr inbounds %[[ROW]][%{{.*}}] : (!llvm.ptr, i64) -> !llvm.ptr, f32
llvm.func @row(%block: !llvm.ptr, %i: i64, %v: f32) attributes {warp.entry} {
  %a = warp.parameter %block[24] packed : !llvm.ptr -> !warp.array<2 x f32>
  %row = warp.view %a[%i] : !warp.array<2 x f32>, i64 -> !warp.array<1 x f32>
  warp.store_components(%v), %row[%i] : (f32), !warp.array<1 x f32>, i64
  llvm.return
}

// -----

// One component of a vector: the data pointer moves, the step stays.
// CHECK-LABEL: llvm.func @component
// CHECK: %[[Y:.*]] = llvm.getelementptr inbounds %{{.*}}[4] : (!llvm.ptr) -> !llvm.ptr, i8
// CHECK: llvm.getelementptr inbounds %[[Y]][%{{.*}}] : (!llvm.ptr, i64) -> !llvm.ptr, !llvm.array<12 x i8>
llvm.func @component(%block: !llvm.ptr, %i: i32, %v: f32)
    attributes {warp.entry} {
  %a = warp.parameter %block[24] packed
    : !llvm.ptr -> !warp.array<1 x !warp.vec<3 x f32>>
  %c1 = arith.constant 1 : i32
  %y = warp.component_view %a[%c1]
    : !warp.array<1 x !warp.vec<3 x f32>>, i32 -> !warp.array<1 x f32>
  warp.store_components(%v), %y[%i] : (f32), !warp.array<1 x f32>, i32
  llvm.return
}

// -----

// A field of a struct lies at its C offset.
// CHECK-LABEL: llvm.func @field
// CHECK: llvm.getelementptr inbounds %{{.*}}[8] : (!llvm.ptr) -> !llvm.ptr, i8
llvm.func @field(%block: !llvm.ptr, %i: i32, %v: f64)
    attributes {warp.entry} {
  %a = warp.parameter %block[24] packed
    : !llvm.ptr -> !warp.array<1 x !warp.struct<"S", {n: si32, x: f64}>>
  %x = warp.component_view %a[] field "x"
    : !warp.array<1 x !warp.struct<"S", {n: si32, x: f64}>>
    -> !warp.array<1 x f64>
  warp.store_components(%v), %x[%i] : (f64), !warp.array<1 x f64>, i32
  llvm.return
}

// -----

// Slice bounds are wrapped and clamped; the length rounds up. The sign of a step
// that is no constant chooses what is clamped to.
// CHECK-LABEL: llvm.func @slice
// CHECK: arith.select %{{.*}}, %c-1{{.*}} : i64
// CHECK: arith.maxsi
// CHECK: arith.minsi
// CHECK: arith.divui
// CHECK: %[[LENGTH:.*]] = arith.trunci %{{.*}} : i64 to i32
// CHECK: llvm.store %[[LENGTH]]
llvm.func @slice(%block: !llvm.ptr, %i: i32) attributes {warp.entry} {
  %a = warp.parameter %block[24] packed : !llvm.ptr -> !warp.array<1 x si32>
  %s = warp.slice %a[%i : %i : %i] dim 0 : !warp.array<1 x si32>, i32, i32, i32
  %n = warp.dim %s, 0 : !warp.array<1 x si32> -> i32
  warp.store_components(%n), %a[%i] : (i32), !warp.array<1 x si32>, i32
  llvm.return
}

// CHECK-LABEL: llvm.func @forward_slice
// CHECK-NOT: %c-1
// CHECK: llvm.return
llvm.func @forward_slice(%block: !llvm.ptr, %i: i32) attributes {warp.entry} {
  %a = warp.parameter %block[24] packed : !llvm.ptr -> !warp.array<1 x si32>
  %two = arith.constant 2 : i32
  %s = warp.slice %a[%i : %i : %two] dim 0 : !warp.array<1 x si32>, i32, i32, i32
  %n = warp.dim %s, 0 : !warp.array<1 x si32> -> i32
  warp.store_components(%n), %a[%i] : (i32), !warp.array<1 x si32>, i32
  llvm.return
}

// RUN: warp-opt %s --split-input-file --warp-lower-arrays | FileCheck %s




// The three loads of one element are adjacent, and so are its stores; a thread
// index is never wrapped, and the address of a packed array has no stride.
// CHECK-LABEL: llvm.func @packed
// CHECK: %[[DATA:.*]] = llvm.load %{{.*}} invariant {alignment = 8
// CHECK: %[[ELEMENT:.*]] = llvm.getelementptr inbounds %[[DATA]][%{{.*}}] : (!llvm.ptr, i64) -> !llvm.ptr, !llvm.array<12 x i8>
// CHECK: %[[P1:.*]] = llvm.getelementptr inbounds %[[ELEMENT]][4]
// CHECK: %[[P2:.*]] = llvm.getelementptr inbounds %[[ELEMENT]][8]
// CHECK-NEXT: llvm.load %[[ELEMENT]]
// CHECK-NEXT: llvm.load %[[P1]]
// CHECK-NEXT: llvm.load %[[P2]]
// CHECK-NOT: arith.select
// CHECK: llvm.store
// CHECK-NEXT: llvm.store
// CHECK-NEXT: llvm.store
llvm.func @packed(%block: !llvm.ptr, %t: i64) attributes {warp.entry} {
  %a = warp.parameter %block[24] packed : !llvm.ptr -> !warp.array<1 x !warp.vec<3 x f32>>
  %i = arith.trunci %t overflow<nsw, nuw> : i64 to i32
  %x, %y, %z = warp.load_components %a[%i]
    : !warp.array<1 x !warp.vec<3 x f32>>, i32 -> f32, f32, f32
  warp.store_components(%z, %y, %x), %a[%i]
    : (f32, f32, f32), !warp.array<1 x !warp.vec<3 x f32>>, i32
  llvm.return
}

// -----

// Strides of any other array are read; an index that may be negative is
// wrapped.
// CHECK-LABEL: llvm.func @strided
// CHECK: %[[EXTENT:.*]] = llvm.load %{{.*}} : !llvm.ptr -> i32
// CHECK: %[[STRIDE:.*]] = llvm.load %{{.*}} : !llvm.ptr -> i32
// CHECK: %[[BYTES:.*]] = arith.extsi %[[STRIDE]]
// CHECK: %[[END:.*]] = arith.addi %[[I:.*]], %[[EXTENT]]
// CHECK: %[[NEGATIVE:.*]] = arith.cmpi slt, %[[I]]
// CHECK: %[[WRAPPED:.*]] = arith.select %[[NEGATIVE]], %[[END]], %[[I]]
// CHECK: %[[WIDE:.*]] = arith.extsi %[[WRAPPED]]
// CHECK: arith.muli %[[WIDE]], %[[BYTES]]
llvm.func @strided(%block: !llvm.ptr, %i: i32, %v: f32)
    attributes {warp.entry} {
  %a = warp.parameter %block[24] : !llvm.ptr -> !warp.array<1 x f32>
  warp.store_components(%v), %a[%i] : (f32), !warp.array<1 x f32>, i32
  llvm.return
}

// -----

// A boolean is a byte in memory.
// CHECK-LABEL: llvm.func @boolean
// CHECK: %[[BYTE:.*]] = llvm.load %{{.*}} {alignment = 1 : i64} : !llvm.ptr -> i8
// CHECK: arith.cmpi ne, %[[BYTE]]
// CHECK: %[[OUT:.*]] = arith.extui %{{.*}} : i1 to i8
// CHECK: llvm.store %[[OUT]]
llvm.func @boolean(%block: !llvm.ptr, %i: i32) attributes {warp.entry} {
  %a = warp.parameter %block[24] packed : !llvm.ptr -> !warp.array<1 x i1>
  %x = warp.load_components %a[%i] : !warp.array<1 x i1>, i32 -> i1
  warp.store_components(%x), %a[%i] : (i1), !warp.array<1 x i1>, i32
  llvm.return
}

// -----

// Arrays that pass through control flow travel as structs.
// CHECK-LABEL: llvm.func @choice
// CHECK: %[[ARRAY:.*]] = scf.if %{{.*}} -> (!llvm.struct<(ptr, i32, i64)>)
// CHECK: llvm.extractvalue %[[ARRAY]][0]
// CHECK-NOT: !warp.array
llvm.func @choice(%block: !llvm.ptr, %i: i32, %c: i1) attributes {warp.entry} {
  %a = warp.parameter %block[24] packed : !llvm.ptr -> !warp.array<1 x f32>
  %b = warp.parameter %block[80] : !llvm.ptr -> !warp.array<1 x f32>
  %x = scf.if %c -> !warp.array<1 x f32> {
    scf.yield %a : !warp.array<1 x f32>
  } else {
    scf.yield %b : !warp.array<1 x f32>
  }
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  warp.store_components(%v), %b[%i] : (f32), !warp.array<1 x f32>, i32
  llvm.return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">>

// On the GPU data is in global memory, and packed elements are counted in 32
// bits.
// CHECK-LABEL: llvm.func @global
// CHECK: %[[NUMBER:.*]] = arith.addi %{{.*}} overflow<nsw> : i32
// CHECK: %[[WIDE:.*]] = arith.extsi %[[NUMBER]] : i32 to i64
// CHECK: llvm.getelementptr inbounds %{{.*}}[%[[WIDE]]] : (!llvm.ptr<1>, i64) -> !llvm.ptr<1>, f32
llvm.func @global(%block: !llvm.ptr, %t: i64, %v: f32)
    attributes {warp.entry, warp.variant = #gpu} {
  %a = warp.parameter %block[24] packed : !llvm.ptr -> !warp.array<2 x f32>
  %i = arith.trunci %t overflow<nsw, nuw> : i64 to i32
  warp.store_components(%v), %a[%i, %i] : (f32), !warp.array<2 x f32>, i32, i32
  llvm.return
}

// -----

// An integer argument that is not negative makes indices that need no wrap.
// CHECK-LABEL: llvm.func @flattened
// CHECK-NOT: arith.select
// CHECK: llvm.store
llvm.func @flattened(%block: !llvm.ptr, %t: i64, %v: f32)
    attributes {warp.entry} {
  %a = warp.parameter %block[24] packed : !llvm.ptr -> !warp.array<1 x f32>
  %w = warp.parameter %block[80] {warp.non_negative} : !llvm.ptr -> i32
  %i = arith.trunci %t overflow<nsw, nuw> : i64 to i32
  %row = arith.muli %i, %w : i32
  %n = arith.addi %row, %i : i32
  warp.store_components(%v), %a[%n] : (f32), !warp.array<1 x f32>, i32
  llvm.return
}

// -----

// But the remainder of what may have overflowed can be negative.
// CHECK-LABEL: llvm.func @hashed
// CHECK: arith.remsi
// CHECK: arith.select
llvm.func @hashed(%block: !llvm.ptr, %t: i64, %v: f32)
    attributes {warp.entry} {
  %a = warp.parameter %block[24] packed : !llvm.ptr -> !warp.array<1 x f32>
  %w = warp.parameter %block[80] {warp.non_negative} : !llvm.ptr -> i32
  %i = arith.trunci %t overflow<nsw, nuw> : i64 to i32
  %prime = arith.constant 73856093 : i32
  %hash = arith.muli %i, %prime : i32
  %n = arith.remsi %hash, %w : i32
  warp.store_components(%v), %a[%n] : (f32), !warp.array<1 x f32>, i32
  llvm.return
}

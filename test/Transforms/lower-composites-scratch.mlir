// RUN: split-file %s %t
// RUN: warp-opt %t/ops.mlir --verify-roundtrip
// RUN: warp-opt %t/ops.mlir --warp-lower-composites | FileCheck %s
// RUN: warp-opt %t/entry.mlir --warp-lower-arrays | FileCheck %s --check-prefix=ENTRY
// RUN: warp-opt %t/errors.mlir -verify-diagnostics -split-input-file
// RUN: warp-opt %t/kernel.mlir --warp-emit=ptx --warp-options=target=sm_90 | FileCheck %s --check-prefix=PTX

//--- ops.mlir

// Each component gets memory of its own; integers lose their sign.
// CHECK-LABEL: func.func @composite
// CHECK-SAME: %[[X:[^:]*]]: f32, %[[Y:[^:]*]]: f32, %[[I:[^:]*]]: i32)
// CHECK: %[[XS:.*]] = warp.scratch : !warp.scratch<4 x f32>
// CHECK: %[[YS:.*]] = warp.scratch : !warp.scratch<4 x f32>
// CHECK: %[[IS:.*]] = warp.scratch : !warp.scratch<2 x i32>
// CHECK: warp.scratch_store %[[X]], %[[XS]][%[[I]]] : f32, !warp.scratch<4 x f32>, i32
// CHECK: warp.scratch_store %[[Y]], %[[YS]][%[[I]]]
// CHECK: warp.scratch_store %[[I]], %[[IS]][%[[I]]] : i32, !warp.scratch<2 x i32>, i32
// CHECK: warp.scratch_load %[[XS]][%[[I]]] : !warp.scratch<4 x f32>, i32 -> f32
// CHECK: warp.scratch_load %[[YS]][%[[I]]]
func.func @composite(%v: !warp.vec<2 x f32>, %i: si32) -> !warp.vec<2 x f32> {
  %s = warp.scratch : !warp.scratch<4 x !warp.vec<2 x f32>>
  %n = warp.scratch : !warp.scratch<2 x si32>
  warp.scratch_store %v, %s[%i] : !warp.vec<2 x f32>, !warp.scratch<4 x !warp.vec<2 x f32>>, si32
  warp.scratch_store %i, %n[%i] : si32, !warp.scratch<2 x si32>, si32
  %w = warp.scratch_load %s[%i] : !warp.scratch<4 x !warp.vec<2 x f32>>, si32 -> !warp.vec<2 x f32>
  return %w : !warp.vec<2 x f32>
}

//--- entry.mlir

// The memory is that of the first block, and a boolean takes a byte.
// ENTRY-LABEL: llvm.func @entry
// ENTRY: %[[FLAGS:.*]] = llvm.alloca %{{.*}} x !llvm.array<8 x i8>
// ENTRY: llvm.br
// ENTRY-NOT: llvm.alloca
// ENTRY: %[[BYTE:.*]] = arith.extui %{{.*}} : i1 to i8
// ENTRY: %[[SLOT:.*]] = llvm.getelementptr inbounds %[[FLAGS]][%{{.*}}] : (!llvm.ptr, i64) -> !llvm.ptr, i8
// ENTRY: llvm.store %[[BYTE]], %[[SLOT]]
// ENTRY: llvm.load
// ENTRY-SAME: -> i8
// ENTRY: arith.trunci
llvm.func @entry(%block: !llvm.ptr, %i: i32, %b: i1) attributes {warp.entry} {
  llvm.br ^body
^body:
  %s = warp.scratch : !warp.scratch<8 x i1>
  warp.scratch_store %b, %s[%i] : i1, !warp.scratch<8 x i1>, i32
  %c = warp.scratch_load %s[%i] : !warp.scratch<8 x i1>, i32 -> i1
  llvm.cond_br %c, ^body, ^exit
^exit:
  llvm.return
}

//--- kernel.mlir

// On a GPU the memory is local to the thread.
// PTX-LABEL: .entry kernel
// PTX: .local .align {{[0-9]+}} .b8
// PTX: st.local
// PTX: ld.local
func.func @kernel(%a: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %c7 = warp.constant 7 : si32
  %x = warp.load %a[%i] : !warp.array<1 x f32>, si32 -> f32
  %j = warp.load %a[%c7] : !warp.array<1 x f32>, si32 -> f32
  %k = warp.cast %j : f32 to si32
  %s = warp.scratch : !warp.scratch<8 x f32>
  warp.scratch_store %x, %s[%c7] : f32, !warp.scratch<8 x f32>, si32
  warp.scratch_store %j, %s[%k] : f32, !warp.scratch<8 x f32>, si32
  %y = warp.scratch_load %s[%c7] : !warp.scratch<8 x f32>, si32 -> f32
  warp.store %y, %a[%i] : f32, !warp.array<1 x f32>, si32
  return
}

//--- errors.mlir

// expected-error@+1 {{(C1) expects 1 to 65536 slots, but got 0}}
func.func private @scratch_c1(!warp.scratch<0 x f32>)

// -----

// expected-error@+1 {{(C2) expects a scalar or composite as element type, but got '!warp.array<1 x f32>'}}
func.func private @scratch_c2(!warp.scratch<4 x !warp.array<1 x f32>>)

// -----

func.func @scratch_load_c1(%s: !warp.scratch<4 x f32>, %i: si32) {
  // expected-error@+1 {{(C1) slots of '!warp.scratch<4 x f32>' have type 'f32', but the result has type 'f64'}}
  %0 = warp.scratch_load %s[%i] : !warp.scratch<4 x f32>, si32 -> f64
  return
}

// -----

func.func @scratch_store_c1(%s: !warp.scratch<4 x f32>, %i: si32, %x: f64) {
  // expected-error@+1 {{(C1) slots of '!warp.scratch<4 x f32>' have type 'f32', but the value has type 'f64'}}
  warp.scratch_store %x, %s[%i] : f64, !warp.scratch<4 x f32>, si32
  return
}

// RUN: warp-opt %s --split-input-file --warp-lower-arrays | FileCheck %s

// A table is one constant, however often it is read; lanes gather.
// CHECK: llvm.mlir.global internal constant @warp_table1(dense<[1, 0]> : tensor<2xi8>) {{.*}}: !llvm.array<2 x i8>
// CHECK: llvm.mlir.global internal constant @warp_table0({{.*}}) {{.*}}: !llvm.array<10 x f32>
// CHECK-NOT: llvm.mlir.global
// CHECK-LABEL: llvm.func @cpu
// CHECK-SAME: %[[I:[^:]*]]: i32, %[[J:[^:]*]]: vector<4xi32>)
// CHECK: %[[BASE:.*]] = llvm.mlir.addressof @warp_table0
// CHECK: %[[WIDE:.*]] = arith.extsi %[[I]] : i32 to i64
// CHECK: %[[AT:.*]] = llvm.getelementptr inbounds %[[BASE]][%[[WIDE]]]
// CHECK: llvm.load %[[AT]] invariant {alignment = 4
// CHECK: %[[EACH:.*]] = llvm.getelementptr %{{.*}}[%[[J]]]
// CHECK: llvm.intr.masked.gather %[[EACH]]
// CHECK: %[[BYTE:.*]] = llvm.load {{.*}} -> i8
// CHECK: arith.trunci %[[BYTE]] : i8 to i1
llvm.func @cpu(%block: !llvm.ptr, %i: i32, %j: vector<4xi32>)
    attributes {warp.entry} {
  %x = warp.table_get dense<[1.0, 2.0, 3.0, 1.0, 1.0, 1.0, 4.0, 1.0, 1.0, 1.0]> : tensor<10xf32> [%i] : i32 -> f32
  %y = warp.table_get dense<[1.0, 2.0, 3.0, 1.0, 1.0, 1.0, 4.0, 1.0, 1.0, 1.0]> : tensor<10xf32> [%j] : vector<4xi32> -> vector<4xf32>
  %z = warp.table_get dense<[true, false]> : tensor<2xi1> [%i] : i32 -> i1
  warp.printf "%f %d"(%x, %z) : f32, i1
  llvm.return
}

// -----

// Lanes choose among few elements.
// CHECK-LABEL: llvm.func @few
// CHECK-SAME: %[[I:[^:]*]]: vector<4xi32>
// CHECK-DAG: %[[A:.*]] = arith.constant dense<1.000000e+00> : vector<4xf32>
// CHECK-DAG: %[[B:.*]] = arith.constant dense<2.000000e+00> : vector<4xf32>
// CHECK-DAG: %[[C:.*]] = arith.constant dense<3.000000e+00> : vector<4xf32>
// CHECK: %[[LOW:.*]] = arith.andi %[[I]]
// CHECK: %[[ODD:.*]] = arith.cmpi ne, %[[LOW]]
// CHECK: %[[PAIR:.*]] = arith.select %[[ODD]], %[[B]], %[[A]]
// CHECK: %[[HIGH:.*]] = arith.andi %[[I]]
// CHECK: %[[LAST:.*]] = arith.cmpi ne, %[[HIGH]]
// CHECK: arith.select %[[LAST]], %[[C]], %[[PAIR]]
// CHECK-NOT: gather
llvm.func @few(%block: !llvm.ptr, %i: vector<4xi32>, %p: !llvm.ptr)
    attributes {warp.entry} {
  %x = warp.table_get dense<[1.0, 2.0, 3.0]> : tensor<3xf32> [%i] : vector<4xi32> -> vector<4xf32>
  llvm.store %x, %p : vector<4xf32>, !llvm.ptr
  llvm.return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, index32 = true>

// The lanes of a warp read the first at one index, and the second at many.
// CHECK-DAG: @warp_table0({{.*}}) {addr_space = 4 : i32
// CHECK-DAG: @warp_table1({{.*}}) {addr_space = 1 : i32
// CHECK-LABEL: llvm.func @nvidia
llvm.func @nvidia(%block: !llvm.ptr, %n: i32)
    attributes {warp.entry, warp.variant = #gpu} {
  %zero = arith.constant 0 : i32
  %one = arith.constant 1 : i32
  %t = gpu.thread_id x
  %lane = arith.index_cast %t : index to i32
  scf.for %i = %zero to %n step %one : i32 {
    %x = warp.table_get dense<[1.0, 2.0]> : tensor<2xf32> [%i] : i32 -> f32
    %at = arith.addi %i, %lane : i32
    %y = warp.table_get dense<[3.0, 2.0]> : tensor<2xf32> [%at] : i32 -> f32
    warp.printf "%f %f"(%x, %y) : f32, f32
  }
  llvm.return
}

// -----

#amd = #warp.variant<target = <name = "gfx90a">, index32 = true>

// CHECK: @warp_table0({{.*}}) {addr_space = 4 : i32
// CHECK-LABEL: llvm.func @amd
llvm.func @amd(%block: !llvm.ptr, %n: i32, %p: !llvm.ptr<1>)
    attributes {warp.entry, warp.variant = #amd} {
  %t = gpu.thread_id x
  %lane = arith.index_cast %t : index to i32
  %y = warp.table_get dense<[3.0, 2.0]> : tensor<2xf32> [%lane] : i32 -> f32
  llvm.store %y, %p : f32, !llvm.ptr<1>
  llvm.return
}

// RUN: warp-opt %s --split-input-file --warp-form-gpu-module --warp-verify-gpu | FileCheck %s
// RUN: warp-opt %s --split-input-file --warp-form-gpu-module \
// RUN:     --warp-convert-to-llvm --warp-verify-llvm | FileCheck %s --check-prefix=LLVM

#gpu = #warp.variant<target = <name = "sm_90">, block_dim = 64>

// All that runs on the card moves into one module. The block's variable is a
// buffer of the kernel, as aligned as it was, and its address is taken wherever
// the variable's was.
// CHECK-NOT: llvm
// CHECK-LABEL: gpu.module @sum
// CHECK: llvm.func @sinf(f32) -> f32
// CHECK: llvm.mlir.global internal constant @text
// CHECK-NOT: llvm.mlir.global
// CHECK: gpu.func @sum(%[[BLOCK:.*]]: !llvm.ptr {llvm.byval = !llvm.array<32 x i8>})
// CHECK-SAME: workgroup(%[[BUFFER:.*]] : memref<32xf32, #gpu.address_space<workgroup>> {llvm.align = 8 : i64})
// CHECK-SAME: kernel
// CHECK-SAME: warp.variant = #warp.variant<target = <name = "sm_90">, block_dim = 64>
// CHECK: llvm.mlir.addressof @text
// CHECK: %[[AT:.*]] = memref.extract_aligned_pointer_as_index %[[BUFFER]]
// CHECK: %[[NUMBER:.*]] = arith.index_cast %[[AT]] : index to i64
// CHECK: %[[POINTER:.*]] = llvm.inttoptr %[[NUMBER]] : i64 to !llvm.ptr<3>
// CHECK: llvm.store %{{.*}}, %[[POINTER]]
// CHECK: gpu.barrier
// CHECK: memref.extract_aligned_pointer_as_index %[[BUFFER]]
// CHECK: gpu.return

// A shuffle is one instruction over the whole warp, and tells nobody whether
// its lane was there.
// LLVM: llvm.mlir.global internal @[[MEMORY:.*]]() {addr_space = 3 : i32, alignment = 8 : i64} : !llvm.array<32 x f32>
// LLVM-LABEL: llvm.func @sum(%{{.*}}: !llvm.ptr {llvm.byval = !llvm.array<32 x i8>})
// LLVM-SAME: nvvm.maxntid = array<i32: 64>
// LLVM: llvm.mlir.addressof @[[MEMORY]]
// LLVM: nvvm.shfl.sync bfly {{.*}} : f32 -> f32
// LLVM: nvvm.barrier
// LLVM: llvm.return
llvm.func @sinf(f32) -> f32
llvm.mlir.global internal constant @text("text")
llvm.mlir.global internal @sums() {addr_space = 3 : i32,
      alignment = 8 : i64} : !llvm.array<32 x f32>
llvm.func ptx_kernelcc @sum(%block: !llvm.ptr {llvm.byval = !llvm.array<32 x i8>})
    attributes {warp.entry, warp.variant = #gpu} {
  %text = llvm.mlir.addressof @text : !llvm.ptr
  %x = llvm.load %block : !llvm.ptr -> f32
  %c1 = arith.constant 1 : i32
  %c32 = arith.constant 32 : i32
  %other, %valid = gpu.shuffle xor %x, %c1, %c32 : f32
  %p = llvm.mlir.addressof @sums : !llvm.ptr<3>
  llvm.store %other, %p : f32, !llvm.ptr<3>
  gpu.barrier
  llvm.br ^exit
^exit:
  %q = llvm.mlir.addressof @sums : !llvm.ptr<3>
  %y = llvm.load %q : !llvm.ptr<3> -> f32
  llvm.return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>>

// An entry for the CPU stays a function.
// CHECK-NOT: gpu
// CHECK: llvm.func @range(%{{.*}}: !llvm.ptr)
// CHECK-NOT: gpu
llvm.func @range(%block: !llvm.ptr)
    attributes {warp.entry, warp.variant = #cpu} {
  llvm.return
}

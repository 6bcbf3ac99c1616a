// RUN: warp-opt %s --split-input-file --warp-lower-launch | FileCheck %s

#gpu = #warp.variant<target = <platform = cuda, version = 90>, rank = 2, block = 128>

// One thread: the last dimension is axis x, the one before it y, and a guard
// stands where the CPU has loops. Nothing is divided.
// CHECK-LABEL: llvm.func ptx_kernelcc @plane
// CHECK-SAME: (%[[BLOCK:.*]]: !llvm.ptr {llvm.align = 8 : i64, llvm.byval = !llvm.array<80 x i8>})
// CHECK-SAME: passthrough = {{\[\[}}"nvvm.maxntid", "128"]]
// CHECK: "llvm.nvvm.read.ptx.sreg.ctaid.x"
// CHECK: "llvm.nvvm.read.ptx.sreg.ntid.x"
// CHECK: "llvm.nvvm.read.ptx.sreg.tid.x"
// CHECK: "llvm.nvvm.read.ptx.sreg.ctaid.y"
// CHECK-NOT: arith.div
// CHECK: llvm.cond_br %{{.*}}, ^[[BODY:bb[0-9]+]], ^[[EXIT:bb[0-9]+]]
// CHECK: ^[[BODY]]:
// CHECK: warp.store_components
// CHECK: llvm.br ^[[EXIT]]
func.func @plane(%a: !warp.array<2 x si32>) attributes {
    warp.kernel, warp.variant = #gpu} {
  %i, %j = warp.tid : i32, i32
  warp.store_components(%i), %a[%i, %j] : (i32), !warp.array<2 x si32>, i32, i32
  return
}

// -----

#gpu2 = #warp.variant<target = <platform = cuda, version = 90>, rank = 2, index32 = false, flat = true>

// The flat variant divides one 64-bit linear index.
// CHECK-LABEL: llvm.func ptx_kernelcc @flat
// CHECK: "llvm.nvvm.read.ptx.sreg.ctaid.x"
// CHECK-NOT: ctaid.y
// CHECK: arith.divui %{{.*}} : i64
func.func @flat(%a: !warp.array<2 x si32>) attributes {
    warp.kernel, warp.variant = #gpu2} {
  %i, %j = warp.tid : i32, i32
  warp.store_components(%i), %a[%i, %j] : (i32), !warp.array<2 x si32>, i32, i32
  return
}

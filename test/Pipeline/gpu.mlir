// RUN: warp-opt %s --warp-pipeline="to-gpu packed=3 target=sm_90" | FileCheck %s
// RUN: warp-opt %s --warp-pipeline="to-gpu packed=3 target=sm_90" | warp-opt | FileCheck %s
// RUN: warp-opt %s --warp-emit=gpu --warp-options=packed=3,target=sm_90 | FileCheck %s
// RUN: warp-opt %s --warp-pipeline="to-gpu packed=3 target=sm_90" \
// RUN:   | warp-opt --warp-convert-to-llvm --warp-verify-llvm | FileCheck %s --check-prefix=LLVM
// RUN: warp-opt %s --warp-pipeline="to-gpu packed=3" | FileCheck %s --check-prefix=CPU

// Before it is NVIDIA's, a launch for a GPU is a kernel of the gpu dialect:
// what it does has structured control flow, arithmetic and pointers.
// CHECK-NOT: {{nvvm|warp\.[a-z_]+[ (]}}
// CHECK-LABEL: gpu.module @saxpy
// CHECK: gpu.func @saxpy(%{{.*}}: !llvm.ptr {llvm.align = 8 : i64, llvm.byval = !llvm.array<144 x i8>}) kernel
// CHECK: gpu.block_id x
// CHECK: gpu.block_dim x
// CHECK: gpu.thread_id x
// CHECK: scf.if
// CHECK-NOT: {{nvvm|warp\.[a-z_]+[ (]}}
// CHECK-COUNT-2: llvm.load
// CHECK: math.fma
// CHECK: llvm.store
// CHECK: gpu.return

// The conversion leaves one function of LLVM's, with all that was said of it.
// Ids are never wider than they are.
// LLVM-NOT: gpu.{{module|func}}
// LLVM-LABEL: llvm.func @saxpy(%{{.*}}: !llvm.ptr {llvm.align = 8 : i64, llvm.byval = !llvm.array<144 x i8>})
// LLVM-SAME: nvvm.kernel
// LLVM-SAME: nvvm.maxntid = array<i32: 256>
// LLVM: %[[BLOCK:.*]] = nvvm.read.ptx.sreg.ctaid.x
// LLVM: %[[WIDTH:.*]] = nvvm.read.ptx.sreg.ntid.x
// LLVM: %[[FIRST:.*]] = llvm.mul %[[BLOCK]], %[[WIDTH]] overflow<nsw, nuw> : i32
// LLVM: %[[THREAD:.*]] = nvvm.read.ptx.sreg.tid.x
// LLVM: llvm.add %[[FIRST]], %[[THREAD]] overflow<nsw, nuw> : i32
// LLVM: llvm.intr.fma
// LLVM: llvm.return

// On the CPU the same phase ends with a function.
// CPU-NOT: gpu.
// CPU-LABEL: llvm.func @saxpy
// CPU: scf.for
func.func @saxpy(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %a: f32)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %0 = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %1 = warp.load %y[%i] : !warp.array<1 x f32>, si32 -> f32
  %2 = warp.mul(%a, %0) : (f32, f32) -> f32
  %3 = warp.add(%2, %1) : (f32, f32) -> f32
  warp.store %3, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

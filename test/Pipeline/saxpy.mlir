// RUN: warp-opt %s --warp-pipeline="to-warp packed=3" | FileCheck %s --check-prefix=WARP
// RUN: warp-opt %s --warp-pipeline="to-thread packed=3" | FileCheck %s --check-prefix=THREAD
// RUN: warp-opt %s --warp-pipeline="to-thread packed=3" | warp-opt | FileCheck %s --check-prefix=THREAD
// RUN: warp-opt %s --warp-pipeline="to-launch packed=3" | FileCheck %s --check-prefix=LAUNCH
// RUN: warp-opt %s --warp-pipeline="to-llvm packed=3" | FileCheck %s --check-prefix=LLVM
// RUN: %if x86-64 %{ warp-opt %s --warp-emit=llvm --warp-options=packed=3,target=cpu:skylake-avx512 | FileCheck %s --check-prefix=IR %}
// RUN: %if x86-64 %{ warp-opt %s --warp-emit=asm --warp-options=packed=3,target=cpu:skylake-avx512 | FileCheck %s --check-prefix=ASM %}
// RUN: warp-opt %s --warp-emit=ptx --warp-options=packed=3,target=sm_90 | FileCheck %s --check-prefix=PTX

// Every stage of one kernel, front-end IR to machine code.

// WARP-LABEL: func.func @saxpy
// WARP: warp.tid : si32
// WARP: warp.load
// WARP: warp.mul
// WARP: warp.store

// THREAD-LABEL: func.func @saxpy
// THREAD: warp.tid : i32
// THREAD: warp.load_components
// THREAD: arith.mulf
// THREAD: warp.store_components

// LAUNCH-LABEL: func.func @saxpy
// LAUNCH: warp.group
// LAUNCH: warp.threads
// LAUNCH: warp.load_lanes unit
// LAUNCH: math.fma
// LAUNCH: warp.store_lanes unit

// LLVM-LABEL: llvm.func @saxpy
// LLVM: llvm.load %{{.*}} : !llvm.ptr -> vector<[[LANES:[0-9]+]]xf32>
// LLVM: llvm.intr.fma
// LLVM: llvm.store %{{.*}} : vector<[[LANES]]xf32>, !llvm.ptr
// LLVM: llvm.intr.masked.load
// LLVM: llvm.intr.masked.store

// Threads are lanes in a loop without a mask and without checks for aliasing;
// those that are left over are one vector with a mask.
// IR-LABEL: define void @saxpy
// IR-NOT: memcheck
// IR: br label %[[LOOP:[0-9]+]]
// IR: [[LOOP]]:
// IR: load <32 x float>
// IR: load <32 x float>
// IR: call <32 x float> @llvm.fma.v32f32
// IR-NOT: masked
// IR: store <32 x float>
// IR: br i1 %{{.*}}, label %[[LOOP]]
// IR-COUNT-2: @llvm.masked.load.v32f32
// IR: @llvm.masked.store.v32f32

// ASM-LABEL: saxpy:
// ASM: vfmadd{{[0-9]+}}ps {{.*}}%zmm

// One thread: no loop, no division, no stride.
// PTX: .version 8.1
// PTX: .target sm_90
// PTX-LABEL: .entry saxpy
// PTX: .param .align 8 .b8 saxpy_param_0[144]
// PTX: .maxntid 256
// PTX-NOT: div.
// PTX: setp.ge.s32
// PTX-COUNT-1: bra
// PTX-NOT: bra
// PTX: ld.global
// PTX: ld.global
// PTX: fma.rn.f32
// PTX: st.global
// PTX: ret;
func.func @saxpy(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %a: f32)
    attributes {warp.kernel, warp.arg_names = ["x", "y", "a"]} {
  %i = warp.tid : si32
  %0 = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %1 = warp.load %y[%i] : !warp.array<1 x f32>, si32 -> f32
  %2 = warp.mul(%a, %0) : (f32, f32) -> f32
  %3 = warp.add(%2, %1) : (f32, f32) -> f32
  warp.store %3, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// REQUIRES: amdgpu
// RUN: warp-opt %s --warp-pipeline="to-gpu packed=3 target=sm_90" \
// RUN:   | mlir-opt --allow-unregistered-dialect \
// RUN:       --pass-pipeline="builtin.module(rocdl-attach-target{chip=gfx90a},gpu.module(convert-scf-to-cf,convert-gpu-to-rocdl{chipset=gfx90a}),convert-to-llvm,reconcile-unrealized-casts)" \
// RUN:       -o %t.mlir
// RUN: FileCheck %s --check-prefix=ROCDL < %t.mlir
// RUN: sed -e '/^[m}]/d' -e 's/gpu.module @saxpy .* attributes/module attributes/' %t.mlir \
// RUN:   | mlir-translate --allow-unregistered-dialect --mlir-to-llvmir \
// RUN:   | llc -mtriple=amdgcn-amd-amdhsa -mcpu=gfx90a \
// RUN:   | FileCheck %s --check-prefix=ISA

// What `to-gpu` leaves says nothing of NVIDIA's: MLIR's own passes take it to
// GPUs of another maker.
// ROCDL: gpu.module @saxpy [#rocdl.target<chip = "gfx90a">]
// ROCDL-LABEL: llvm.func @saxpy
// ROCDL-SAME: rocdl.kernel
// ROCDL: rocdl.workgroup.id.x
// ROCDL: rocdl.workitem.id.x
// ROCDL: llvm.intr.fma
// ROCDL: llvm.return

// LLVM makes that module's content code. The size of a block is a function of
// ROCm's library of device code, which the linker would add.
// ISA: .amdgcn_target "amdgcn-amd-amdhsa--gfx90a"
// ISA-LABEL: saxpy:
// ISA: v_cmp_
// ISA-COUNT-2: global_load_dword v
// ISA: {{v_fma_f32|v_fmac_f32|v_pk_fma_f32}}
// ISA: global_store_dword v
// ISA: s_endpgm
// ISA: .amdhsa_kernel saxpy
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

// REQUIRES: amdgpu
// RUN: warp-opt %s --warp-pipeline="to-gpu contiguous=3 target=sm_90" \
// RUN:   | mlir-opt --allow-unregistered-dialect \
// RUN:       --pass-pipeline="builtin.module(rocdl-attach-target{chip=gfx942},gpu.module(convert-scf-to-cf,convert-gpu-to-rocdl{chipset=gfx942}),convert-to-llvm,reconcile-unrealized-casts)" \
// RUN:       -o %t.mlir
// RUN: FileCheck %s --check-prefix=ROCDL < %t.mlir
// RUN: mlir-opt %t.mlir --allow-unregistered-dialect \
// RUN:     --gpu-module-to-binary=format=isa | FileCheck %s --check-prefix=ISA

// What `to-gpu` leaves says nothing of NVIDIA's: MLIR's own passes take it to
// GPUs of another maker.
// ROCDL-LABEL: llvm.func @saxpy
// ROCDL-SAME: rocdl.kernel
// ROCDL: rocdl.workgroup.id.x
// ROCDL: rocdl.workitem.id.x
// ROCDL: llvm.intr.fma
// ROCDL: llvm.return

// ISA: .amdgcn_target \22amdgcn-amd-amdhsa--gfx942
// ISA-SAME: saxpy:
// ISA-SAME: v_cmp_
// ISA-SAME: global_load_dword v
// ISA-SAME: global_load_dword v
// ISA-SAME: {{v_fma_f32|v_fmac_f32|v_pk_fma_f32}}
// ISA-SAME: global_store_dword v
// ISA-SAME: s_endpgm
// ISA-SAME: .amdhsa_kernel saxpy
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

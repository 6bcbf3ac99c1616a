// REQUIRES: amdgpu
// RUN: split-file %s %t
// RUN: warp-opt %t/saxpy.mlir --warp-pipeline="to-llvm packed=3 target=gfx90a" \
// RUN:   | mlir-translate --allow-unregistered-dialect --mlir-to-llvmir \
// RUN:   | llc -mtriple=amdgcn-amd-amdhsa -mcpu=gfx90a \
// RUN:   | FileCheck %t/saxpy.mlir
// RUN: warp-opt %t/total.mlir --warp-pipeline="to-llvm packed=3 target=gfx90a" \
// RUN:   | mlir-translate --allow-unregistered-dialect --mlir-to-llvmir \
// RUN:   | llc -mtriple=amdgcn-amd-amdhsa -mcpu=gfx90a \
// RUN:   | FileCheck %t/total.mlir -D#MASK=63
// RUN: warp-opt %t/total.mlir --warp-pipeline="to-llvm packed=3 target=gfx1100" \
// RUN:   | mlir-translate --allow-unregistered-dialect --mlir-to-llvmir \
// RUN:   | llc -mtriple=amdgcn-amd-amdhsa -mcpu=gfx1100 \
// RUN:   | FileCheck %t/total.mlir -D#MASK=31
// RUN: warp-opt %t/root.mlir --warp-pipeline="to-llvm packed=3 target=gfx1100" \
// RUN:   | mlir-translate --allow-unregistered-dialect --mlir-to-llvmir \
// RUN:   | llc -mtriple=amdgcn-amd-amdhsa -mcpu=gfx1100 \
// RUN:   | FileCheck %t/root.mlir
// RUN: warp-opt %t/table.mlir --warp-pipeline="to-llvm packed=3 target=gfx90a" \
// RUN:   | mlir-translate --allow-unregistered-dialect --mlir-to-llvmir \
// RUN:   | llc -mtriple=amdgcn-amd-amdhsa -mcpu=gfx90a \
// RUN:   | FileCheck %t/table.mlir
// RUN: not warp-opt %t/root.mlir --warp-emit=asm --warp-options=target=gfx90a 2>&1 \
// RUN:   | FileCheck %t/root.mlir --check-prefix=EMIT

//--- saxpy.mlir

// Parameters are read from constant memory, the size of a block from the packet
// that launched the kernel.
// CHECK: .amdgcn_target "amdgcn-amd-amdhsa--gfx90a"
// CHECK-LABEL: saxpy:
// CHECK: s_load_dword
// CHECK: v_cmp_
// CHECK-COUNT-2: global_load_dword v
// CHECK: {{v_fma_f32|v_fmac_f32|v_pk_fma_f32}}
// CHECK: global_store_dword v
// CHECK: s_endpgm
// CHECK: .amdhsa_kernel saxpy
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

//--- total.mlir

// A block combines its threads' numbers: lanes of a wave by exchanges, waves of
// 64 or 32 lanes by shared memory and a barrier; one thread adds the total.
// CHECK-LABEL: total:
// CHECK-DAG: ds_bpermute_b32
// CHECK-DAG: [[#MASK]]
// CHECK: ds_{{write|store}}_b32
// CHECK: s_barrier
// CHECK: ds_{{read|load}}_b32
// CHECK: {{global|flat}}_atomic
// CHECK: .amdhsa_kernel total
func.func @total(%x: !warp.array<1 x f32>, %out: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %zero = warp.constant 0 : si32
  %0 = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %1 = warp.atomic add %0, %out[%zero] : f32, !warp.array<1 x f32>, si32 -> f32
  return
}

//--- root.mlir

// An approximation and a step of Newton's method; output goes to the launch's
// buffer, by a function of the device library.
// CHECK-LABEL: root:
// CHECK-DAG: v_rsq_f32
// CHECK-DAG: warp_gpu_printf
// CHECK: .amdhsa_kernel root
// EMIT: no code generator for target 'gfx90a', lower to LLVM IR and use llc
func.func @root(%x: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %0 = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %1 = warp.sqrt(%0) : (f32) -> f32
  %one = warp.constant 1.000000e+00 : f32
  %2 = warp.div(%one, %1) : (f32, f32) -> f32
  warp.store %2, %x[%i] : f32, !warp.array<1 x f32>, si32
  warp.printf "%f\0A"(%2) : f32
  return
}

//--- table.mlir

// A constant table is read by a scalar load at an index that all lanes have, and
// by a vector load otherwise.
// CHECK-LABEL: read:
// CHECK: warp_table0@rel32@lo
// CHECK: global_load_dword v{{[0-9]+}}, v{{[0-9]+}}, s[
// CHECK: warp_table1@rel32@lo
// CHECK: s_load_dword s{{[0-9]+}}, s[{{.*}}], s
// CHECK: s_endpgm
func.func @read(%x: !warp.array<1 x f32>, %n: si32) attributes {warp.kernel} {
  %t = warp.tid : si32
  %zero = arith.constant 0 : i32
  %one = arith.constant 1 : i32
  %end = warp.cast %n : si32 to i32
  %a = warp.table_get dense<[1.0, 3.0, 2.0]> : tensor<3xf32> [%t] : si32 -> f32
  %b = scf.for %i = %zero to %end step %one iter_args(%s = %a) -> (f32) : i32 {
    %q = warp.cast %i : i32 to si32
    %w = warp.table_get dense<[4.0, 6.0, 2.0]> : tensor<3xf32> [%q] : si32 -> f32
    %y = warp.mul(%s, %w) : (f32, f32) -> f32
    scf.yield %y : f32
  }
  warp.store %b, %x[%t] : f32, !warp.array<1 x f32>, si32
  return
}

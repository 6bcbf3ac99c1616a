// Code for aarch64: lanes are vectors of NEON, an atomic update needs no
// function of a run-time library, and the long functions of the device library
// are those of its one level.
//
// REQUIRES: aarch64
// RUN: split-file %s %t
// RUN: warp-opt %t/sine.mlir --warp-emit=asm | FileCheck %t/sine.mlir
// RUN: warp-opt %t/count.mlir --warp-emit=asm | FileCheck %t/count.mlir
// RUN: warp-opt %t/furthest.mlir --warp-emit=asm | FileCheck %t/furthest.mlir

//--- sine.mlir
// The sine is part of the loop, on four lanes a register.
// CHECK-LABEL: sine:
// CHECK-NOT: bl warp_sinf
// CHECK: {{fmul|fmla}} v{{[0-9]+}}.4s, v{{[0-9]+}}.4s, v{{[0-9]+}}.
// CHECK: .size sine
func.func @sine(%x: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %s = warp.sin(%v) : (f32) -> f32
  warp.store %s, %x[%i] : f32, !warp.array<1 x f32>, si32
  return
}

//--- count.mlir
// CHECK-LABEL: count:
// CHECK-NOT: __aarch64_
// CHECK: {{ldaxr|ldxr|ldadd}}
// CHECK-NOT: __aarch64_
func.func @count(%x: !warp.array<1 x si32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %one = warp.constant 1 : si32
  %v = warp.load %x[%i] : !warp.array<1 x si32>, si32 -> si32
  %old = warp.atomic add %one, %x[%v] : si32, !warp.array<1 x si32>, si32 -> si32
  warp.store %old, %x[%i] : si32, !warp.array<1 x si32>, si32
  return
}

//--- furthest.mlir
// CHECK: bl warp_mesh_furthest.v8
func.func @k(%mesh: ui64, %x: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %zero = warp.constant 0.0 : f32
  %from = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %hit:3 = warp.library_call "warp_mesh_furthest"(%mesh, %from, %zero, %zero, %zero)
      : (ui64, f32, f32, f32, f32) -> (si32, f32, f32)
  warp.store %hit#1, %x[%i] : f32, !warp.array<1 x f32>, si32
  return
}

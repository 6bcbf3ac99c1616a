// RUN: warp-opt %s | warp-opt | FileCheck %s

!v3 = !warp.vec<3 x f32>
!s = !warp.struct<"S", {x: !v3}>

// The array of gradients has the type of the array, but wide elements.
// CHECK-LABEL: func.func @types
func.func @types(%a: !warp.array<2 x !v3>, %h: !warp.array<1 x f16>,
                 %b: !warp.array<1 x !warp.mat<2x2 x bf16>>,
                 %n: !warp.array<3 x si32>, %s: !warp.array<1 x !s>) {
  // CHECK: warp.grad %{{.*}} : !warp.array<2 x !warp.vec<3 x f32>> -> !warp.array<2 x !warp.vec<3 x f32>>
  %0 = warp.grad %a : !warp.array<2 x !v3> -> !warp.array<2 x !v3>
  // CHECK: warp.grad %{{.*}} : !warp.array<1 x f16> -> !warp.array<1 x f32>
  %1 = warp.grad %h : !warp.array<1 x f16> -> !warp.array<1 x f32>
  // CHECK: warp.grad %{{.*}} -> !warp.array<1 x !warp.mat<2x2 x f32>>
  %2 = warp.grad %b : !warp.array<1 x !warp.mat<2x2 x bf16>> -> !warp.array<1 x !warp.mat<2x2 x f32>>
  // CHECK: warp.grad %{{.*}} -> !warp.array<3 x si32>
  %3 = warp.grad %n : !warp.array<3 x si32> -> !warp.array<3 x si32>
  // CHECK: warp.grad %{{.*}} -> !warp.array<1 x !S>
  %4 = warp.grad %s : !warp.array<1 x !s> -> !warp.array<1 x !s>
  return
}

// CHECK-LABEL: func.func @accumulate
func.func @accumulate(%a: !warp.array<2 x !v3>, %i: si32, %v: !v3) {
  // CHECK: warp.accumulate %{{.*}}, %{{.*}}[%{{.*}}, %{{.*}}] : !warp.vec<3 x f32>, !warp.array<2 x !warp.vec<3 x f32>>, si32, si32
  warp.accumulate %v, %a[%i, %i] : !v3, !warp.array<2 x !v3>, si32, si32
  // CHECK: warp.accumulate %{{.*}}, %{{.*}}[%{{.*}}, %{{.*}}] {unique = 2 : i64} :
  warp.accumulate %v, %a[%i, %i] {unique = 2} : !v3, !warp.array<2 x !v3>, si32, si32
  return
}

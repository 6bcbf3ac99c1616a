// RUN: split-file %s %t
// RUN: warp-opt %t/stores.mlir --warp-emit=tangent | FileCheck %t/stores.mlir
// RUN: warp-opt %t/flags.mlir --warp-differentiate-kernel="mode=forward active=1" | FileCheck %t/flags.mlir --check-prefix=FLAGS
// RUN: warp-opt %t/letters.mlir --warp-differentiate-kernel="mode=forward active=x" --verify-diagnostics

//--- stores.mlir
// Integers that are stored to an array, or added to it, have no tangent.
// CHECK-LABEL: func.func @stores_tangent
// CHECK: warp.store {{.*}} : si32
// CHECK-NEXT: warp.atomic add
// CHECK-NEXT: warp.load
// CHECK: warp.store {{.*}} : f32
// CHECK-NEXT: warp.store {{.*}} : f32
module {
  func.func @stores(%n: !warp.array<1 x si32>, %x: !warp.array<1 x f32>)
      attributes {warp.arg_names = ["n", "x"], warp.kernel} {
    %i = warp.tid : si32
    warp.store %i, %n[%i] : si32, !warp.array<1 x si32>, si32
    %o = warp.atomic add %i, %n[%i] : si32, !warp.array<1 x si32>, si32 -> si32
    %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
    %r = warp.mul(%v, %v) : (f32, f32) -> f32
    warp.store %r, %x[%i] : f32, !warp.array<1 x f32>, si32
    return
  }
}

//--- flags.mlir
// Arrays without a flag have no tangent.
// FLAGS-LABEL: func.func @flags_tangent
// FLAGS-SAME: leaf = 0
// FLAGS-NOT: leaf = 1
// FLAGS: warp.store {{.*}}, %arg1
// FLAGS-NOT: warp.store
func.func @flags(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.arg_names = ["x", "y"], warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  warp.store %v, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

//--- letters.mlir
// expected-error @+1 {{expects 0 and 1 in 'active', but got 'x'}}
func.func @letters(%x: !warp.array<1 x f32>)
    attributes {warp.arg_names = ["x"], warp.kernel} {
  return
}

// RUN: warp-opt %s -warp-inline-pullbacks=active=10 | FileCheck %s

// The gradient of a row is the row of the gradient; an array without a
// gradient is left alone, and what is read of its gradient is zero.
// CHECK-LABEL: @rows(
// CHECK-SAME: %[[A:.*]]: !warp.array<2 x f32>, %[[B:.*]]: !warp.array<2 x f32>)
// CHECK: %[[GA:.*]] = warp.grad %[[A]]
// CHECK: %[[ROW:.*]] = warp.view %[[GA]]
// CHECK: warp.atomic add %{{.*}}, %[[ROW]]
// CHECK-NOT: warp.grad
// CHECK-NOT: warp.atomic
// CHECK: return
func.func @rows(%a: !warp.array<2 x f32>, %b: !warp.array<2 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %ra = warp.view %a[%i] : !warp.array<2 x f32>, si32 -> !warp.array<1 x f32>
  %rb = warp.view %b[%i] : !warp.array<2 x f32>, si32 -> !warp.array<1 x f32>
  call @pullback(%ra, %i) : (!warp.array<1 x f32>, si32) -> ()
  call @pullback(%rb, %i) : (!warp.array<1 x f32>, si32) -> ()
  return
}
func.func private @pullback(%x: !warp.array<1 x f32>, %i: si32) attributes {no_inline} {
  %g = warp.grad %x : !warp.array<1 x f32> -> !warp.array<1 x f32>
  %v = warp.load %g[%i] : !warp.array<1 x f32>, si32 -> f32
  %w = warp.sin(%v) : (f32) -> f32
  %old = warp.atomic add %w, %g[%i] : f32, !warp.array<1 x f32>, si32 -> f32
  return
}

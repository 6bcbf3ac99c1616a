// RUN: warp-opt %s --warp-pipeline="to-llvm" -verify-diagnostics

// Only an argument's descriptor leads to gradients; a view of gradients is
// taken of the gradients.
func.func @of_view(%a: !warp.array<2 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.view %a[%i] : !warp.array<2 x f32>, si32 -> !warp.array<1 x f32>
  // expected-error@+1 {{expects the array of a gradient to be an argument of the kernel or a field of one}}
  %g = warp.grad %v : !warp.array<1 x f32> -> !warp.array<1 x f32>
  %x = warp.constant 1.0 : f32
  warp.store %x, %g[%i] : f32, !warp.array<1 x f32>, si32
  return
}

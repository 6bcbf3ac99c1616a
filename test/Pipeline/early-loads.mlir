// RUN: warp-opt %s --warp-emit=ptx --warp-options=target=sm_90 | FileCheck %s

// A load that only a branch uses, and that of its index, are made beside the
// load of the condition. A load that the program makes in a branch stays there.
// CHECK-LABEL: .visible .entry gather(
// CHECK: bra
// CHECK-COUNT-3: ld.global
// CHECK-NOT: ld.global
// CHECK: bra
// CHECK: ld.global
// CHECK-NOT: ld.global
// CHECK: st.global
func.func @gather(%a: !warp.array<1 x si32>, %c: !warp.array<1 x si32>,
                  %x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.arg_names = ["a", "c", "x", "y"]} {
  %i = warp.tid : si32
  %j = warp.load %c[%i] : !warp.array<1 x si32>, si32 -> si32
  %v = warp.load %x[%j] : !warp.array<1 x f32>, si32 -> f32
  %f = warp.load %a[%i] : !warp.array<1 x si32>, si32 -> si32
  %zero = warp.constant 0 : si32
  %is = warp.gt(%f, %zero) : (si32, si32) -> i1
  scf.if %is {
    %u = warp.load %y[%i] : !warp.array<1 x f32>, si32 -> f32
    %w = warp.mul(%u, %v) : (f32, f32) -> f32
    warp.store %w, %y[%i] : f32, !warp.array<1 x f32>, si32
  }
  return
}

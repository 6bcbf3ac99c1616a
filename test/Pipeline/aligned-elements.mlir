// RUN: warp-opt %s --warp-emit=ptx --warp-options=packed=7,target=sm_90 | FileCheck %s
// RUN: warp-opt %s --warp-emit=ptx --warp-options=packed=0,target=sm_90 | FileCheck %s --check-prefix=ANY

// Elements of packed arrays are aligned: one access has up to 16 bytes of them.
// Half of an element, and those of other arrays, have their scalars' alignment.
// CHECK-LABEL: .entry turned
// CHECK: ld.global.v4.b32
// CHECK: ld.global.v2.b32
// CHECK-NOT: ld.global
// CHECK: st.global.v2.b32
// CHECK-NOT: st.global.v
// ANY-LABEL: .entry turned
// ANY-NOT: {{(ld|st)}}.global.v
// ANY: st.global.b32
!q = !warp.vec<4 x f32>
!v = !warp.vec<2 x f32>
func.func @turned(%a: !warp.array<1 x !q>, %b: !warp.array<1 x !v>, %c: !warp.array<1 x !q>)
    attributes {warp.kernel, warp.arg_names = ["a", "b", "c"]} {
  %i = warp.tid : si32
  %q = warp.load %a[%i] : !warp.array<1 x !q>, si32 -> !q
  %v = warp.load %b[%i] : !warp.array<1 x !v>, si32 -> !v
  %d = warp.dot(%q, %q) : (!q, !q) -> f32
  %r = warp.mul(%v, %d) : (!v, f32) -> !v
  warp.store %r, %b[%i] : !v, !warp.array<1 x !v>, si32
  %k = warp.constant 1 : si32
  %view = warp.component_view %c[%k] : !warp.array<1 x !q>, si32 -> !warp.array<1 x f32>
  warp.store %d, %view[%i] : f32, !warp.array<1 x f32>, si32
  return
}

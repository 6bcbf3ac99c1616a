// RUN: warp-opt %s --warp-emit=ptx --warp-options=packed=7,target=sm_90 | FileCheck %s

// A matrix lives in registers. Its nine loads are offsets of one address, and so
// are those of a thread of a whole warp, which loads words next to those of its
// neighbours. The vector is stored by adjacent stores.
// CHECK-LABEL: .entry mat33
// CHECK-NOT: .local
// CHECK: activemask
// CHECK: ld.global.b32 %r{{[0-9]+}}, [%[[A:rd[0-9]+]]];
// CHECK-NEXT: ld.global.b32 %r{{[0-9]+}}, [%[[A]]+4];
// CHECK-NEXT: ld.global.b32 %r{{[0-9]+}}, [%[[A]]+8];
// CHECK-NEXT: ld.global.b32 %r{{[0-9]+}}, [%[[A]]+12];
// CHECK-NEXT: ld.global.b32 %r{{[0-9]+}}, [%[[A]]+16];
// CHECK-NEXT: ld.global.b32 %r{{[0-9]+}}, [%[[A]]+20];
// CHECK-NEXT: ld.global.b32 %r{{[0-9]+}}, [%[[A]]+24];
// CHECK-NEXT: ld.global.b32 %r{{[0-9]+}}, [%[[A]]+28];
// CHECK-NEXT: ld.global.b32 %r{{[0-9]+}}, [%[[A]]+32];
// CHECK: bar.warp.sync
// CHECK: ld.global.b32 %r{{[0-9]+}}, [%[[S:rd[0-9]+]]];
// CHECK-NEXT: ld.global.b32 %r{{[0-9]+}}, [%[[S]]+128];
// CHECK-NEXT: ld.global.b32 %r{{[0-9]+}}, [%[[S]]+256];
// CHECK-NEXT: ld.global.b32 %r{{[0-9]+}}, [%[[S]]+384];
// CHECK-NEXT: ld.global.b32 %r{{[0-9]+}}, [%[[S]]+512];
// CHECK-NEXT: ld.global.b32 %r{{[0-9]+}}, [%[[S]]+640];
// CHECK-NEXT: ld.global.b32 %r{{[0-9]+}}, [%[[S]]+768];
// CHECK-NEXT: ld.global.b32 %r{{[0-9]+}}, [%[[S]]+896];
// CHECK-NEXT: ld.global.b32 %r{{[0-9]+}}, [%[[S]]+1024];
// CHECK-NOT: {{(ld|st)}}.local
// CHECK-NOT: call
// CHECK: st.global.b32 [%[[Y:rd[0-9]+]]],
// CHECK-NEXT: st.global.b32 [%[[Y]]+4],
// CHECK-NEXT: st.global.b32 [%[[Y]]+8],
// CHECK-NOT: st.global
!m = !warp.mat<3x3 x f32>
!v = !warp.vec<3 x f32>
func.func @mat33(%a: !warp.array<1 x !m>, %b: !warp.array<1 x !v>,
                 %y: !warp.array<1 x !v>)
    attributes {warp.kernel, warp.arg_names = ["a", "b", "y"]} {
  %i = warp.tid : si32
  %m = warp.load %a[%i] : !warp.array<1 x !m>, si32 -> !m
  %v = warp.load %b[%i] : !warp.array<1 x !v>, si32 -> !v
  %t = warp.transpose(%m) : (!m) -> !m
  %0 = warp.mul(%t, %v) : (!m, !v) -> !v
  %d = warp.determinant(%m) : (!m) -> f32
  %1 = warp.mul(%0, %d) : (!v, f32) -> !v
  warp.store %1, %y[%i] : !v, !warp.array<1 x !v>, si32
  return
}

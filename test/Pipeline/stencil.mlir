// RUN: warp-opt %s --warp-emit=ptx --warp-options=rank=3,packed=3,target=sm_90 | FileCheck %s
// RUN: warp-opt %s --warp-emit=ptx --warp-options=rank=3,packed=3,target=sm_90,flat | FileCheck %s --check-prefix=FLAT

// A launch of three dimensions lies on the grid's axes: indices come from
// special registers, 32 bits wide, without a division; neighbours along the
// last dimension are offsets of one address.
// CHECK-LABEL: .entry stencil
// CHECK-NOT: .local
// CHECK-NOT: {{div|rem}}.
// CHECK-DAG: %ctaid.x
// CHECK-DAG: %ctaid.y
// CHECK-DAG: %ctaid.z
// CHECK-NOT: {{div|rem}}.
// CHECK-NOT: mul.lo.s64
// CHECK: ld.global.b32 %r{{[0-9]+}}, [%[[AT:rd[0-9]+]]];
// CHECK-DAG: ld.global.b32 %r{{[0-9]+}}, [%[[AT]]+-4];
// CHECK-DAG: ld.global.b32 %r{{[0-9]+}}, [%[[AT]]+4];
// CHECK: st.global.b32
// CHECK-NOT: {{div|rem}}.
// CHECK: ret;

// One linear index has to be taken apart.
// FLAT-LABEL: .entry stencil
// FLAT: {{div|rem}}.
!a = !warp.array<3 x f32>
func.func @stencil(%u: !a, %out: !a)
    attributes {warp.kernel, warp.arg_names = ["u", "out"]} {
  %zero = warp.constant 0 : si32
  %one = warp.constant 1 : si32
  %i, %j, %k = warp.tid : si32, si32, si32
  %inside = warp.gt(%k, %zero) : (si32, si32) -> i1
  scf.if %inside {
    %before = warp.sub(%k, %one) : (si32, si32) -> si32
    %after = warp.add(%k, %one) : (si32, si32) -> si32
    %0 = warp.load %u[%i, %j, %k] : !a, si32, si32, si32 -> f32
    %1 = warp.load %u[%i, %j, %before] : !a, si32, si32, si32 -> f32
    %2 = warp.load %u[%i, %j, %after] : !a, si32, si32, si32 -> f32
    %3 = warp.add(%1, %2) : (f32, f32) -> f32
    %4 = warp.sub(%3, %0) : (f32, f32) -> f32
    warp.store %4, %out[%i, %j, %k] : f32, !a, si32, si32, si32
  }
  return
}

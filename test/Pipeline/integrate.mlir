// RUN: warp-opt %s --warp-emit=ptx --warp-options=packed=15,target=sm_90 | FileCheck %s --check-prefix=PTX
// RUN: %if x86-64 %{ warp-opt %s --warp-emit=llvm --warp-options=packed=15,target=cpu:skylake-avx512 | FileCheck %s --check-prefix=IR %}

// The loads of each vector are adjacent, all loads come before all stores, and
// the stores of x come before those of v.
// PTX-LABEL: .entry integrate
// PTX-NOT: .local
// PTX: ld.global.b32 %r{{[0-9]+}}, [%[[X:rd[0-9]+]]];
// PTX-NEXT: ld.global.b32 %r{{[0-9]+}}, [%[[X]]+4];
// PTX-NEXT: ld.global.b32 %r{{[0-9]+}}, [%[[X]]+8];
// PTX-NOT: st.global
// PTX: ld.global.b32 %r{{[0-9]+}}, [%[[V:rd[0-9]+]]];
// PTX-NEXT: ld.global.b32 %r{{[0-9]+}}, [%[[V]]+4];
// PTX-NEXT: ld.global.b32 %r{{[0-9]+}}, [%[[V]]+8];
// PTX-NOT: st.global
// PTX: st.global.b32 [%[[X]]]
// PTX-NEXT: st.global.b32 [%[[X]]+4]
// PTX-NEXT: st.global.b32 [%[[X]]+8]
// PTX-NEXT: st.global.b32 [%[[V]]]
// PTX-NEXT: st.global.b32 [%[[V]]+4]
// PTX-NEXT: st.global.b32 [%[[V]]+8]

// On the CPU, lanes are threads: a vec3 of 32 of them is three vectors, taken
// apart and put together by shuffles. Roundings are in the IR, not up to LLVM.
// IR-LABEL: define void @integrate
// IR-NOT: contract
// IR: br label %[[LOOP:[0-9]+]]
// IR: [[LOOP]]:
// IR-COUNT-3: load <32 x float>
// IR-COUNT-6: shufflevector <32 x float>
// IR-NOT: gather
// IR-COUNT-9: @llvm.fma.v32f32
// IR-NOT: scatter
// IR-COUNT-6: store <32 x float>
// IR: br i1 %{{.*}}, label %[[LOOP]]
func.func @integrate(%x: !warp.array<1 x !warp.vec<3 x f32>>, %v: !warp.array<1 x !warp.vec<3 x f32>>, %f: !warp.array<1 x !warp.vec<3 x f32>>, %w: !warp.array<1 x f32>, %g: !warp.vec<3 x f32>, %dt: f32) attributes {warp.kernel, warp.arg_names = ["x", "v", "f", "w", "g", "dt"]} {
  %i = warp.tid : si32
  %x0 = warp.load %x[%i] : !warp.array<1 x !warp.vec<3 x f32>>, si32 -> !warp.vec<3 x f32>
  %v0 = warp.load %v[%i] : !warp.array<1 x !warp.vec<3 x f32>>, si32 -> !warp.vec<3 x f32>
  %f0 = warp.load %f[%i] : !warp.array<1 x !warp.vec<3 x f32>>, si32 -> !warp.vec<3 x f32>
  %w0 = warp.load %w[%i] : !warp.array<1 x f32>, si32 -> f32
  %a0 = warp.mul(%f0, %w0) : (!warp.vec<3 x f32>, f32) -> !warp.vec<3 x f32>
  %a1 = warp.add(%a0, %g) : (!warp.vec<3 x f32>, !warp.vec<3 x f32>) -> !warp.vec<3 x f32>
  %dv = warp.mul(%a1, %dt) : (!warp.vec<3 x f32>, f32) -> !warp.vec<3 x f32>
  %v1 = warp.add(%v0, %dv) : (!warp.vec<3 x f32>, !warp.vec<3 x f32>) -> !warp.vec<3 x f32>
  %dx = warp.mul(%v1, %dt) : (!warp.vec<3 x f32>, f32) -> !warp.vec<3 x f32>
  %x1 = warp.add(%x0, %dx) : (!warp.vec<3 x f32>, !warp.vec<3 x f32>) -> !warp.vec<3 x f32>
  warp.store %x1, %x[%i] : !warp.vec<3 x f32>, !warp.array<1 x !warp.vec<3 x f32>>, si32
  warp.store %v1, %v[%i] : !warp.vec<3 x f32>, !warp.array<1 x !warp.vec<3 x f32>>, si32
  return
}

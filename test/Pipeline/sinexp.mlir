// REQUIRES: x86-64
// RUN: warp-opt %s --warp-emit=llvm --warp-options=packed=3,target=cpu:skylake-avx512 | FileCheck %s
// RUN: warp-opt %s --warp-emit=ptx --warp-options=packed=3,target=sm_90 | FileCheck %s --check-prefix=PTX

// The device library is inlined and runs in vectors of floats: no call of a
// function of it is left, and nothing is widened to double precision.
// CHECK-LABEL: define void @sinexp
// CHECK-NOT: @{{(warp_)?(sin|exp)}}
// CHECK-NOT: x double>
// CHECK: load <32 x float>
// CHECK-COUNT-8: call noundef <16 x float> @llvm.fma.v16f32
// CHECK: store <32 x float>
// CHECK-NOT: @{{(warp_)?(sin|exp)f?\(}}
// CHECK: ret void

// libdevice is linked in, as far as it is used.
// PTX-NOT: .extern
// PTX: .entry sinexp
// PTX-NOT: call
// PTX: ex2.approx
func.func @sinexp(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>) attributes {warp.kernel, warp.arg_names = ["x", "y"]} {
  %i = warp.tid : si32
  %0 = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %1 = warp.sin(%0) : (f32) -> f32
  %2 = warp.exp(%0) : (f32) -> f32
  %3 = warp.mul(%1, %2) : (f32, f32) -> f32
  warp.store %3, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

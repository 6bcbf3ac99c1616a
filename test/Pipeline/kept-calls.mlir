// Large functions with several calls stay calls where the kernel has more scalar
// operations than its budget.
//
// RUN: sed "s/= 250 :/= 1000 :/" %s | warp-opt - --warp-pipeline=to-warp | FileCheck %s --check-prefix=WITHIN
// RUN: warp-opt %s --warp-pipeline=to-warp | FileCheck %s --check-prefix=BEYOND
// RUN: warp-opt %s --warp-pipeline=to-thread | FileCheck %s --check-prefix=THREAD
// RUN: warp-opt %s --warp-emit=llvm --warp-options=lanes=1 | FileCheck %s --check-prefix=IR
// RUN: warp-opt %s --warp-emit=llvm --warp-options=lanes=8 | FileCheck %s --check-prefix=LANES
// RUN: warp-opt %s --warp-emit=ptx --warp-options=target=sm_90 | FileCheck %s --check-prefix=PTX

// A kernel within its budget has all calls inlined.
// WITHIN-NOT: call
// WITHIN: func.func @kernel
// WITHIN-NOT: call
// WITHIN-NOT: func.func

// Beyond it `large` stays. `small`, a function with one call, and one that asks
// for the thread's index are inlined as ever.
// BEYOND-NOT: func.func private @{{small|once|index}}
// BEYOND: func.func private @large
// BEYOND-SAME: warp.kept
// BEYOND-NOT: call
// BEYOND: func.func @kernel
// BEYOND-SAME: warp.keeps_calls
// BEYOND-COUNT-2: call @large
// BEYOND-NOT: call

// In thread IR arguments and results are scalars, and arrays as they are.
// THREAD: func.func private @large
// THREAD-SAME: (%{{.*}}: !warp.array<1 x f32>, %{{.*}}: i32, %{{.*}}: f32) -> (f32, i32)

// Functions of the target take arrays as pointer, extents and strides, and
// return several results as one struct. On a CPU one call is for all lanes.
// IR: define internal {{.*}}{ float, i32 } @large({ ptr, i32, i64 } %
// IR: define {{.*}}@kernel
// IR-COUNT-2: call {{.*}}{ float, i32 } @large({ ptr, i32, i64 } %{{.*}}, i32 %{{.*}}, float
// LANES: define internal {{.*}}{ <8 x float>, <8 x i32> } @large_lanes(<8 x i1> %{{.*}}, { ptr, i32, i64 } %{{.*}}, <8 x i32> %{{.*}}, <8 x float> %
// LANES: define {{.*}}@kernel
// LANES-COUNT-2: call {{.*}}{ <8 x float>, <8 x i32> } @large_lanes(<8 x i1>
// PTX: .func (.param .align {{[0-9]+}} .b8 func_retval0[8]) large(
// PTX: .entry kernel(
// PTX-COUNT-2: call{{(.uni)?}} (retval0), large,
!m = !warp.mat<4x4 x f32>
!a = !warp.array<1 x f32>
func.func private @small(%x: f32) -> f32 {
  %y = warp.mul(%x, %x) : (f32, f32) -> f32
  return %y : f32
}
func.func private @large(%a: !a, %i: si32, %x: f32) -> (f32, si32) {
  %e = warp.load %a[%i] : !a, si32 -> f32
  %s = call @small(%e) : (f32) -> f32
  %0 = warp.construct(%x) : (f32) -> !m
  %1 = warp.mul(%0, %s) : (!m, f32) -> !m
  %2 = warp.mul(%1, %0) : (!m, !m) -> !m
  %3 = warp.add(%2, %1) : (!m, !m) -> !m
  %4 = warp.mul(%3, %2) : (!m, !m) -> !m
  %5 = warp.mul(%4, %x) : (!m, f32) -> !m
  %6 = warp.determinant(%5) : (!m) -> f32
  %c = warp.constant 1 : si32
  %7 = warp.add(%i, %c) : (si32, si32) -> si32
  return %6, %7 : f32, si32
}
func.func private @once(%x: f32) -> !m {
  %0 = warp.construct(%x) : (f32) -> !m
  %1 = warp.mul(%0, %0) : (!m, !m) -> !m
  %2 = warp.mul(%1, %1) : (!m, !m) -> !m
  %3 = warp.mul(%2, %2) : (!m, !m) -> !m
  %4 = warp.mul(%3, %3) : (!m, !m) -> !m
  return %4 : !m
}
func.func private @index(%x: f32) -> !m {
  %i = warp.tid : si32
  %f = warp.cast %i : si32 to f32
  %0 = warp.construct(%f) : (f32) -> !m
  %1 = warp.mul(%0, %x) : (!m, f32) -> !m
  %2 = warp.mul(%1, %1) : (!m, !m) -> !m
  %3 = warp.mul(%2, %2) : (!m, !m) -> !m
  %4 = warp.mul(%3, %3) : (!m, !m) -> !m
  return %4 : !m
}
func.func @kernel(%a: !a) attributes {warp.kernel, warp.inline_budget = 250 : i64} {
  %i = warp.tid : si32
  %x = warp.load %a[%i] : !a, si32 -> f32
  %0, %j = call @large(%a, %i, %x) : (!a, si32, f32) -> (f32, si32)
  %1, %k = call @large(%a, %j, %0) : (!a, si32, f32) -> (f32, si32)
  %m = call @once(%1) : (f32) -> !m
  %n = call @index(%x) : (f32) -> !m
  %o = call @index(%1) : (f32) -> !m
  %p = warp.mul(%m, %n) : (!m, !m) -> !m
  %q = warp.mul(%p, %o) : (!m, !m) -> !m
  %y = warp.determinant(%q) : (!m) -> f32
  %z = call @small(%y) : (f32) -> f32
  warp.store %z, %a[%k] : f32, !a, si32
  return
}

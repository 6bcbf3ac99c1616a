// Loops may carry arrays; the schedules of GPUs that share a loop's iterations,
// or run it for two threads at a time, leave those alone.
//
// RUN: warp-opt %s --warp-emit=ptx --warp-options="target=sm_90" | FileCheck %s

// CHECK: .entry swap
// CHECK: ld.global
// CHECK: st.global
func.func @swap(%arg0: !warp.array<1 x f32>, %arg1: !warp.array<1 x f32>, %arg2: !warp.array<1 x f32>, %arg3: si32) attributes {warp.arg_names = ["a", "b", "out", "n"], warp.kernel} {
  %0 = warp.constant 0.000000e+00 : f32
  %1 = warp.constant 0 : si32
  %2 = warp.constant 1 : si32
  %3 = warp.tid : si32
  %4 = warp.cast %arg3 : si32 to i32
  %5 = warp.cast %1 : si32 to i32
  %6 = warp.cast %2 : si32 to i32
  %7:3 = scf.for %arg4 = %5 to %4 step %6 iter_args(%arg5 = %arg0, %arg6 = %arg1, %arg7 = %0) -> (!warp.array<1 x f32>, !warp.array<1 x f32>, f32)  : i32 {
    %8 = warp.cast %arg4 : i32 to si32
    %9 = warp.load %arg5[%8] : !warp.array<1 x f32>, si32 -> f32
    %10 = warp.add(%arg7, %9) : (f32, f32) -> f32
    scf.yield %arg6, %arg5, %10 : !warp.array<1 x f32>, !warp.array<1 x f32>, f32
  }
  warp.store %7#2, %arg2[%3] : f32, !warp.array<1 x f32>, si32
  return
}

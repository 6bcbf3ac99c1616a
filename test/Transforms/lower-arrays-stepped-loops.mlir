// RUN: warp-opt %s --warp-pipeline="to-llvm" | FileCheck %s
// RUN: warp-opt %s --warp-pipeline="to-llvm target=sm_90" | FileCheck %s

// Indices of a loop that counts trips from a thread's index are not wrapped.
// CHECK-LABEL: llvm.func {{.*}}@trips
// CHECK: llvm.icmp "ult"
// CHECK-NOT: llvm.select
// CHECK: llvm.fadd
func.func @trips(%x: !warp.array<1 x f32>, %n: si32, %out: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %c8 = warp.constant 8 : si32
  %trips = warp.cast %n : si32 to i32
  %zero = warp.constant 0.0 : f32
  %sum = scf.for unsigned %k = %c0 to %trips step %c1 iter_args(%s = %zero)
      -> (f32) : i32 {
    %trip = warp.cast %k : i32 to si32
    %far = warp.mul(%trip, %c8) : (si32, si32) -> si32
    %j = warp.add(%i, %far) : (si32, si32) -> si32
    %v = warp.load %x[%j] : !warp.array<1 x f32>, si32 -> f32
    %next = warp.add(%s, %v) : (f32, f32) -> f32
    scf.yield %next : f32
  }
  warp.store %sum, %out[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// RUN: warp-opt %s --warp-emit=ptx --warp-options=packed=15,target=sm_90 | FileCheck %s --check-prefix=PTX
// RUN: warp-opt %s --warp-pipeline="to-llvm packed=15 lanes=8" | FileCheck %s --check-prefix=CPU

// The lanes of a warp read `weights` at one index, and `codes` at many.
// PTX-DAG: .const .align 16 .b8 warp_table1[40]
// PTX-DAG: .global .align 16 .b8 warp_table0[40]
// PTX-LABEL: .entry read
// PTX-NOT: .local
// PTX: mov.b64 %[[MANY:rd[0-9]+]], warp_table0;
// PTX: ld.global.nc.b32
// PTX: ld.const.b32
// PTX: ret;

// Integers that become floats are kept as floats.
// CPU-COUNT-2: llvm.mlir.global internal constant @warp_table{{.*}} : !llvm.array<10 x f32>
// CPU: llvm.intr.masked.gather
// CPU: llvm.load {{.*}} invariant {alignment = 4 : i64} : !llvm.ptr -> f32
func.func @read(%x: !warp.array<1 x f32>, %k: !warp.array<1 x si32>, %n: si32)
    attributes {warp.kernel} {
  %t = warp.tid : si32
  %zero = arith.constant 0 : i32
  %one = arith.constant 1 : i32
  %end = warp.cast %n : si32 to i32
  %place = warp.load %k[%t] : !warp.array<1 x si32>, si32 -> si32
  %code = warp.table_get dense<[7, 1, 2, 9, 4, 5, 6, 7, 8, 9]> : tensor<10xsi16> [%place] : si32 -> si16
  %from = warp.cast %code : si16 to f32
  %sum = scf.for %i = %zero to %end step %one iter_args(%s = %from) -> (f32) : i32 {
    %q = warp.cast %i : i32 to si32
    %w = warp.table_get dense<[1.0, 2.0, 4.0, 8.0, 3.0, 5.0, 6.0, 7.0, 9.0, 11.0]> : tensor<10xf32> [%q] : si32 -> f32
    %y = warp.mul(%s, %w) : (f32, f32) -> f32
    scf.yield %y : f32
  }
  warp.store %sum, %x[%t] : f32, !warp.array<1 x f32>, si32
  return
}

// Quickly compiled code for a GPU whose products the library has calls all that
// it has of them: the sums lie in the thread's memory. Elsewhere products are
// part of the kernel.
//
// RUN: warp-opt %s --warp-emit=ptx \
// RUN:   --warp-options=target=sm_90a,rank=3,block-dim=128,linked=true | FileCheck %s
// RUN: warp-opt %s --warp-emit=ptx \
// RUN:   --warp-options=target=sm_80,rank=3,block-dim=128,linked=true \
// RUN:   | FileCheck %s --check-prefix=INLINED

// CHECK-DAG: .extern .func warp_tile_set_f32_8x8_kn
// CHECK-DAG: .extern .func warp_tile_multiply_f32_8x8_kn
// CHECK-DAG: .extern .func warp_tile_store_f32_8x8_kn
// CHECK: .entry product
// CHECK: .local .align
// CHECK-NOT: fma.rn.f32
// CHECK-NOT: {{^}}.func
// INLINED-NOT: .extern .func
// INLINED: fma.rn.f32
func.func @product(%a: !warp.array<2 x f32>, %b: !warp.array<2 x f32>,
                   %c: !warp.array<2 x f32>)
    attributes {warp.kernel, warp.block_threads = 128 : i64,
                warp.arg_names = ["a", "b", "c"]} {
  %none = warp.constant 0.0 : f32
  %c16 = warp.constant 16 : si32
  %c64 = warp.constant 64 : si32
  %c128 = warp.constant 128 : si32
  %i0 = arith.constant 0 : i32
  %i1 = arith.constant 1 : i32
  %i8 = arith.constant 8 : i32
  %place:2 = warp.tid : si32, si32
  %row = warp.mul(%place#0, %c128) : (si32, si32) -> si32
  %column = warp.mul(%place#1, %c64) : (si32, si32) -> si32
  %sums = warp.tile_splat %none : f32 -> !warp.tile<128x64 x f32>
  %made = scf.for %i = %i0 to %i8 step %i1 iter_args(%s = %sums)
      -> (!warp.tile<128x64 x f32>) : i32 {
    %step = warp.cast %i : i32 to si32
    %k = warp.mul(%step, %c16) : (si32, si32) -> si32
    %x = warp.tile_load %a[%row, %k] : !warp.array<2 x f32>, (si32, si32)
      -> !warp.tile<128x16 x f32>
    %y = warp.tile_load %b[%k, %column] : !warp.array<2 x f32>, (si32, si32)
      -> !warp.tile<16x64 x f32>
    %t = warp.tile_matmul %x, %y add %s : !warp.tile<128x16 x f32>,
      !warp.tile<16x64 x f32> add !warp.tile<128x64 x f32>
      -> !warp.tile<128x64 x f32>
    scf.yield %t : !warp.tile<128x64 x f32>
  }
  warp.tile_store %made, %c[%row, %column] : !warp.tile<128x64 x f32>,
    !warp.array<2 x f32>, (si32, si32)
  return
}

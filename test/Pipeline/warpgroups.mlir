// RUN: warp-opt %s --warp-emit=ptx --warp-options=target=sm_90a,rank=3,block-dim=256 > %t.ptx
// RUN: FileCheck %s --input-file=%t.ptx
// RUN: FileCheck %s --input-file=%t.ptx --check-prefix=AWAITED
// RUN: %if ptxas %{ ptxas -arch=sm_90a -v %t.ptx -o %t.cubin 2>&1 | FileCheck %s --check-prefix=ASSEMBLED %}

// Products of halves by warpgroups: copies are published before barriers,
// and the assembler keeps what is asynchronous so, without memory for sums.
// CHECK: .target sm_90a
// CHECK: .align 1024
// CHECK: fence.proxy.async.shared::cta
// CHECK: bar.sync
// CHECK: wgmma.fence.sync.aligned
// CHECK-COUNT-4: wgmma.mma_async.sync.aligned.m64n128k16.f32.f16.f16
// CHECK: wgmma.commit_group.sync.aligned
// AWAITED: wgmma.wait_group.sync.aligned 0
// ASSEMBLED-NOT: serialized
// ASSEMBLED: 0 bytes spill stores
// ASSEMBLED-NOT: serialized
func.func @product(%a: !warp.array<2 x f16>, %b: !warp.array<2 x f16>,
                   %c: !warp.array<2 x f32>)
    attributes {warp.kernel, warp.block_threads = 256 : i64,
                warp.arg_names = ["a", "b", "c"]} {
  %none = warp.constant 0.0 : f32
  %c32 = warp.constant 32 : si32
  %c128 = warp.constant 128 : si32
  %i0 = arith.constant 0 : i32
  %i1 = arith.constant 1 : i32
  %i8 = arith.constant 8 : i32
  %place:2 = warp.tid : si32, si32
  %row = warp.mul(%place#0, %c128) : (si32, si32) -> si32
  %column = warp.mul(%place#1, %c128) : (si32, si32) -> si32
  %sums = warp.tile_splat %none : f32 -> !warp.tile<128x128 x f32>
  %made = scf.for %i = %i0 to %i8 step %i1 iter_args(%s = %sums)
      -> (!warp.tile<128x128 x f32>) : i32 {
    %step = warp.cast %i : i32 to si32
    %k = warp.mul(%step, %c32) : (si32, si32) -> si32
    %x = warp.tile_load %a[%row, %k] : !warp.array<2 x f16>, (si32, si32)
      -> !warp.tile<128x32 x f16>
    %y = warp.tile_load %b[%k, %column] : !warp.array<2 x f16>, (si32, si32)
      -> !warp.tile<32x128 x f16>
    %t = warp.tile_matmul %x, %y add %s : !warp.tile<128x32 x f16>,
      !warp.tile<32x128 x f16> add !warp.tile<128x128 x f32>
      -> !warp.tile<128x128 x f32>
    scf.yield %t : !warp.tile<128x128 x f32>
  }
  warp.tile_store %made, %c[%row, %column] : !warp.tile<128x128 x f32>,
    !warp.array<2 x f32>, (si32, si32)
  return
}

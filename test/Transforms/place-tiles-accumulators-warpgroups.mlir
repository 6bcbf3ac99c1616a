// RUN: warp-opt %s --split-input-file --warp-place-tiles | FileCheck %s

#own = #warp.variant<target = <name = "sm_90a">, rank = 3>

// Warpgroups multiply halves, which lie swizzled, and a loop of an even number
// of steps takes two at a time, so that rows have 128 bytes.
// CHECK-LABEL: func.func @even
// CHECK: %[[STEP:.*]] = arith.constant 2 : i32
// CHECK: scf.for {{.*}} step %[[STEP]]
// CHECK: warp.tile_load %arg0{{.*}}pitch = 64, swizzled = true, stages = 3
// CHECK-SAME: !warp.tile<128x64 x f16>
// CHECK: warp.tile_load %arg1{{.*}}pitch = 128, swizzled = true, stages = 3
// CHECK-SAME: !warp.tile<64x128 x f16>
// CHECK: warp.tile_matmul {{.*}}warp.function = #warp.tile_function<name = "wg_f16_64x128_kn", accumulators = "wg_64x128", slots = 64>, warp.layout = #warp.tile_layout<storage = accumulators>
func.func @even(%a: !warp.array<2 x f16>, %b: !warp.array<2 x f16>,
                %c: !warp.array<2 x f32>)
    attributes {warp.kernel, warp.block_threads = 256 : i64,
                warp.variant = #own} {
  %none = warp.constant 0.0 : f32
  %c0 = warp.constant 0 : si32
  %c32 = warp.constant 32 : si32
  %i0 = arith.constant 0 : i32
  %i1 = arith.constant 1 : i32
  %i8 = arith.constant 8 : i32
  %sums = warp.tile_splat %none : f32 -> !warp.tile<128x128 x f32>
  %made = scf.for %i = %i0 to %i8 step %i1 iter_args(%s = %sums)
      -> (!warp.tile<128x128 x f32>) : i32 {
    %step = warp.cast %i : i32 to si32
    %k = warp.mul(%step, %c32) : (si32, si32) -> si32
    %x = warp.tile_load %a[%c0, %k] : !warp.array<2 x f16>, (si32, si32)
      -> !warp.tile<128x32 x f16>
    %y = warp.tile_load %b[%k, %c0] : !warp.array<2 x f16>, (si32, si32)
      -> !warp.tile<32x128 x f16>
    %t = warp.tile_matmul %x, %y add %s : !warp.tile<128x32 x f16>,
      !warp.tile<32x128 x f16> add !warp.tile<128x128 x f32>
      -> !warp.tile<128x128 x f32>
    scf.yield %t : !warp.tile<128x128 x f32>
  }
  warp.tile_store %made, %c[%c0, %c0] : !warp.tile<128x128 x f32>,
    !warp.array<2 x f32>, (si32, si32)
  return
}

// -----

#own = #warp.variant<target = <name = "sm_90a">, rank = 3>

// With an unknown number of steps the last may be missing: loads know how much
// of the depth belongs to one. Views of factors get their shape.
// CHECK-LABEL: func.func @unknown
// CHECK: warp.tile_load %arg0{{.*}}merged_axis = 1, merged_extent = 16
// CHECK-SAME: !warp.tile<64x64 x bf16>
// CHECK: warp.tile_load %arg1{{.*}}merged_axis = 1, merged_extent = 16
// CHECK-SAME: !warp.tile<64x64 x bf16>
// CHECK: warp.tile_matmul {{.*}}warp.function = #warp.tile_function<name = "wg_bf16_64x64_kk", accumulators = "wg_64x64", slots = 32>, warp.layout = #warp.tile_layout<storage = accumulators>
func.func @unknown(%a: !warp.array<2 x bf16>, %b: !warp.array<2 x bf16>,
                   %c: !warp.array<2 x f32>, %n: i32)
    attributes {warp.kernel, warp.block_threads = 128 : i64,
                warp.variant = #own} {
  %none = warp.constant 0.0 : f32
  %c0 = warp.constant 0 : si32
  %c16 = warp.constant 16 : si32
  %i0 = arith.constant 0 : i32
  %i1 = arith.constant 1 : i32
  %sums = warp.tile_splat %none : f32 -> !warp.tile<64x64 x f32>
  %made = scf.for %i = %i0 to %n step %i1 iter_args(%s = %sums)
      -> (!warp.tile<64x64 x f32>) : i32 {
    %step = warp.cast %i : i32 to si32
    %k = warp.mul(%step, %c16) : (si32, si32) -> si32
    %x = warp.tile_load %a[%c0, %k] : !warp.array<2 x bf16>, (si32, si32)
      -> !warp.tile<64x16 x bf16>
    %y = warp.tile_load %b[%c0, %k] : !warp.array<2 x bf16>, (si32, si32)
      -> !warp.tile<64x16 x bf16>
    %z = warp.tile_transpose %y, [1, 0] : !warp.tile<64x16 x bf16>
      -> !warp.tile<16x64 x bf16>
    %t = warp.tile_matmul %x, %z add %s : !warp.tile<64x16 x bf16>,
      !warp.tile<16x64 x bf16> add !warp.tile<64x64 x f32>
      -> !warp.tile<64x64 x f32>
    scf.yield %t : !warp.tile<64x64 x f32>
  }
  warp.tile_store %made, %c[%c0, %c0] : !warp.tile<64x64 x f32>,
    !warp.array<2 x f32>, (si32, si32)
  return
}

// -----

#any = #warp.variant<target = <name = "sm_90">, rank = 3>

// Code that later architectures run, too, has no such instructions.
// CHECK-LABEL: func.func @any
// CHECK: warp.function = #warp.tile_function<name = "f16_32x32_kn", accumulators = "mma_32x32", slots = 32>
func.func @any(%a: !warp.array<2 x f16>, %c: !warp.array<2 x f32>)
    attributes {warp.kernel, warp.block_threads = 128 : i64,
                warp.variant = #any} {
  %c0 = warp.constant 0 : si32
  %x = warp.tile_load %a[%c0, %c0] : !warp.array<2 x f16>, (si32, si32)
    -> !warp.tile<64x64 x f16>
  %t = warp.tile_matmul %x, %x : !warp.tile<64x64 x f16>,
    !warp.tile<64x64 x f16> -> !warp.tile<64x64 x f32>
  warp.tile_store %t, %c[%c0, %c0] : !warp.tile<64x64 x f32>,
    !warp.array<2 x f32>, (si32, si32)
  return
}

// -----

#disjoint = #warp.variant<target = <name = "sm_90a">, rank = 3, disjoint = true>

// TMA loads arguments that the kernel does not write to. Each has a tensor map
// behind the arguments: descriptor, offset, box, bytes of an element and of the
// swizzle.
// CHECK-LABEL: func.func @tma
// CHECK-SAME: warp.tensor_maps = [array<i64: 24, 192, 128, 64, 2, 128>, array<i64: 80, 320, 64, 64, 2, 128>]
// CHECK: warp.tile_load %arg0{{.*}}pitch = 64, swizzled = true, {{.*}}tensor_map = 192, barriers = true
// CHECK: warp.tile_load %arg1{{.*}}pitch = 128, swizzled = true, {{.*}}tensor_map = 320>
func.func @tma(%a: !warp.array<2 x f16>, %b: !warp.array<2 x f16>,
                 %c: !warp.array<2 x f32>)
    attributes {warp.kernel, warp.block_threads = 256 : i64,
                warp.variant = #disjoint} {
  %none = warp.constant 0.0 : f32
  %c0 = warp.constant 0 : si32
  %c64 = warp.constant 64 : si32
  %i0 = arith.constant 0 : i32
  %i1 = arith.constant 1 : i32
  %i7 = arith.constant 7 : i32
  %sums = warp.tile_splat %none : f32 -> !warp.tile<128x128 x f32>
  %made = scf.for %i = %i0 to %i7 step %i1 iter_args(%s = %sums)
      -> (!warp.tile<128x128 x f32>) : i32 {
    %step = warp.cast %i : i32 to si32
    %k = warp.mul(%step, %c64) : (si32, si32) -> si32
    %x = warp.tile_load %a[%c0, %k] : !warp.array<2 x f16>, (si32, si32)
      -> !warp.tile<128x64 x f16>
    %y = warp.tile_load %b[%k, %c0] : !warp.array<2 x f16>, (si32, si32)
      -> !warp.tile<64x128 x f16>
    %t = warp.tile_matmul %x, %y add %s : !warp.tile<128x64 x f16>,
      !warp.tile<64x128 x f16> add !warp.tile<128x128 x f32>
      -> !warp.tile<128x128 x f32>
    scf.yield %t : !warp.tile<128x128 x f32>
  }
  warp.tile_store %made, %c[%c0, %c0] : !warp.tile<128x128 x f32>,
    !warp.array<2 x f32>, (si32, si32)
  return
}

// -----

#disjoint = #warp.variant<target = <name = "sm_90a">, rank = 3, disjoint = true>

// Single precision comes in boxes, too, 32 elements of the depth at a time: what
// lies along it swizzled, what lies across as it is.
// CHECK-LABEL: func.func @singles
// CHECK-SAME: warp.tensor_maps = [array<i64: 24, 192, 128, 32, 4, 128>, array<i64: 80, 320, 32, 128, 4, 0>]
// CHECK: %[[STEPS:.*]] = arith.constant 2 : i32
// CHECK: scf.for {{.*}} step %[[STEPS]]
// CHECK: warp.tile_load %arg0{{.*}}pitch = 32, swizzled = true, {{.*}}tensor_map = 192, barriers = true
// CHECK-NOT: swizzled
// CHECK: warp.function = #warp.tile_function<name = "f32_8x8_kn", accumulators = "f32_8x8_kn", slots = 64>, warp.layout = #warp.tile_layout<storage = accumulators>
func.func @singles(%a: !warp.array<2 x f32>, %b: !warp.array<2 x f32>,
                   %c: !warp.array<2 x f32>)
    attributes {warp.kernel, warp.block_threads = 256 : i64,
                warp.variant = #disjoint} {
  %none = warp.constant 0.0 : f32
  %c0 = warp.constant 0 : si32
  %c16 = warp.constant 16 : si32
  %i0 = arith.constant 0 : i32
  %i1 = arith.constant 1 : i32
  %i6 = arith.constant 6 : i32
  %sums = warp.tile_splat %none : f32 -> !warp.tile<128x128 x f32>
  %made = scf.for %i = %i0 to %i6 step %i1 iter_args(%s = %sums)
      -> (!warp.tile<128x128 x f32>) : i32 {
    %step = warp.cast %i : i32 to si32
    %k = warp.mul(%step, %c16) : (si32, si32) -> si32
    %x = warp.tile_load %a[%c0, %k] : !warp.array<2 x f32>, (si32, si32)
      -> !warp.tile<128x16 x f32>
    %y = warp.tile_load %b[%k, %c0] : !warp.array<2 x f32>, (si32, si32)
      -> !warp.tile<16x128 x f32>
    %t = warp.tile_matmul %x, %y add %s : !warp.tile<128x16 x f32>,
      !warp.tile<16x128 x f32> add !warp.tile<128x128 x f32>
      -> !warp.tile<128x128 x f32>
    scf.yield %t : !warp.tile<128x128 x f32>
  }
  warp.tile_store %made, %c[%c0, %c0] : !warp.tile<128x128 x f32>,
    !warp.array<2 x f32>, (si32, si32)
  return
}

// -----

#disjoint = #warp.variant<target = <name = "sm_90a">, rank = 3, disjoint = true>

// Threads copy the arrays that the kernel writes to.
// CHECK-LABEL: func.func @written
// CHECK-NOT: warp.tensor_maps
// CHECK: warp.tile_load %arg0{{.*}}swizzled
func.func @written(%a: !warp.array<2 x f16>, %b: !warp.array<2 x f16>,
                   %c: !warp.array<2 x f32>)
    attributes {warp.kernel, warp.block_threads = 128 : i64,
                warp.variant = #disjoint} {
  %none = warp.constant 0.0 : f32
  %half = warp.constant 0.0 : f16
  %c0 = warp.constant 0 : si32
  %c64 = warp.constant 64 : si32
  %i0 = arith.constant 0 : i32
  %i1 = arith.constant 1 : i32
  %i7 = arith.constant 7 : i32
  %empty = warp.tile_splat %half : f16 -> !warp.tile<64x64 x f16>
  warp.tile_store %empty, %a[%c0, %c0] : !warp.tile<64x64 x f16>,
    !warp.array<2 x f16>, (si32, si32)
  %sums = warp.tile_splat %none : f32 -> !warp.tile<64x64 x f32>
  %made = scf.for %i = %i0 to %i7 step %i1 iter_args(%s = %sums)
      -> (!warp.tile<64x64 x f32>) : i32 {
    %step = warp.cast %i : i32 to si32
    %k = warp.mul(%step, %c64) : (si32, si32) -> si32
    %x = warp.tile_load %a[%c0, %k] : !warp.array<2 x f16>, (si32, si32)
      -> !warp.tile<64x64 x f16>
    %y = warp.tile_load %b[%k, %c0] : !warp.array<2 x f16>, (si32, si32)
      -> !warp.tile<64x64 x f16>
    %t = warp.tile_matmul %x, %y add %s : !warp.tile<64x64 x f16>,
      !warp.tile<64x64 x f16> add !warp.tile<64x64 x f32>
      -> !warp.tile<64x64 x f32>
    scf.yield %t : !warp.tile<64x64 x f32>
  }
  warp.tile_store %made, %c[%c0, %c0] : !warp.tile<64x64 x f32>,
    !warp.array<2 x f32>, (si32, si32)
  return
}

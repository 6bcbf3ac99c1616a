// RUN: warp-opt %s --split-input-file --warp-place-tiles | FileCheck %s

#gpu = #warp.variant<target = <name = "sm_90">, rank = 3>

// Matrix instructions of doubles came with compute capability 9.0; those of
// halves give halves, too.
// CHECK-LABEL: func.func @doubles
// CHECK: warp.tile_matmul {{.*}}warp.function = #warp.tile_function<name = "f64_32x16_kn", accumulators = "f64_mma_32x16", slots = 16>
// CHECK: warp.tile_matmul {{.*}}warp.function = #warp.tile_function<name = "bf16_32x16_kn", accumulators = "mma_32x16", slots = 16>
func.func @doubles(%a: !warp.array<2 x f64>, %b: !warp.array<2 x bf16>)
    attributes {warp.kernel, warp.block_threads = 64 : i64,
                warp.variant = #gpu} {
  %c0 = warp.constant 0 : si32
  %x = warp.tile_load %a[%c0, %c0] : !warp.array<2 x f64>, (si32, si32)
    -> !warp.tile<32x32 x f64>
  %s = warp.tile_matmul %x, %x : !warp.tile<32x32 x f64>,
    !warp.tile<32x32 x f64> -> !warp.tile<32x32 x f64>
  warp.tile_store %s, %a[%c0, %c0] : !warp.tile<32x32 x f64>,
    !warp.array<2 x f64>, (si32, si32)
  %y = warp.tile_load %b[%c0, %c0] : !warp.array<2 x bf16>, (si32, si32)
    -> !warp.tile<32x32 x bf16>
  %t = warp.tile_matmul %y, %y : !warp.tile<32x32 x bf16>,
    !warp.tile<32x32 x bf16> -> !warp.tile<32x32 x bf16>
  warp.tile_store %t, %b[%c0, %c0] : !warp.tile<32x32 x bf16>,
    !warp.array<2 x bf16>, (si32, si32)
  return
}

// -----

#older = #warp.variant<target = <name = "sm_80">, rank = 3>

// CHECK-LABEL: func.func @older_doubles
// CHECK-NOT: accumulators = 
func.func @older_doubles(%a: !warp.array<2 x f64>)
    attributes {warp.kernel, warp.block_threads = 64 : i64,
                warp.variant = #older} {
  %c0 = warp.constant 0 : si32
  %x = warp.tile_load %a[%c0, %c0] : !warp.array<2 x f64>, (si32, si32)
    -> !warp.tile<32x32 x f64>
  %s = warp.tile_matmul %x, %x : !warp.tile<32x32 x f64>,
    !warp.tile<32x32 x f64> -> !warp.tile<32x32 x f64>
  warp.tile_store %s, %a[%c0, %c0] : !warp.tile<32x32 x f64>,
    !warp.array<2 x f64>, (si32, si32)
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, rank = 3>

// 64 of 256 threads hold the sums of a small tile, a warp of 8 those of another.
// CHECK-LABEL: func.func @some_threads
// CHECK: warp.tile_matmul {{.*}}warp.function = #warp.tile_function<name = "f32_4x4_kn", accumulators = "f32_4x4_kn", slots = 16>
// CHECK: warp.tile_matmul {{.*}}warp.function = #warp.tile_function<name = "f16_16x16_kn", accumulators = "mma_16x16", slots = 8>
func.func @some_threads(%a: !warp.array<2 x f32>, %b: !warp.array<2 x f16>)
    attributes {warp.kernel, warp.block_threads = 256 : i64,
                warp.variant = #gpu} {
  %c0 = warp.constant 0 : si32
  %x = warp.tile_load %a[%c0, %c0] : !warp.array<2 x f32>, (si32, si32)
    -> !warp.tile<32x32 x f32>
  %s = warp.tile_matmul %x, %x : !warp.tile<32x32 x f32>,
    !warp.tile<32x32 x f32> -> !warp.tile<32x32 x f32>
  warp.tile_store %s, %a[%c0, %c0] : !warp.tile<32x32 x f32>,
    !warp.array<2 x f32>, (si32, si32)
  %y = warp.tile_load %b[%c0, %c0] : !warp.array<2 x f16>, (si32, si32)
    -> !warp.tile<16x16 x f16>
  %t = warp.tile_matmul %y, %y : !warp.tile<16x16 x f16>,
    !warp.tile<16x16 x f16> -> !warp.tile<16x16 x f32>
  warp.tile_store %t, %a[%c0, %c0] : !warp.tile<16x16 x f32>,
    !warp.array<2 x f32>, (si32, si32)
  return
}

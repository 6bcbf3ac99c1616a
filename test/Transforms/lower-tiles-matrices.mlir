// RUN: warp-opt %s --split-input-file --warp-place-tiles --warp-plan-tile-memory --warp-place-barriers --warp-lower-tiles | FileCheck %s

#gpu = #warp.variant<target = <name = "sm_90">, rank = 2>

// A matrix is copied by all threads at once, and waited for where they meet.
// CHECK-LABEL: func.func @factor
// CHECK: warp.library_call "warp_tile_fetch_b32"
// CHECK-NEXT: warp.library_call "warp_tile_close_group"
// CHECK: warp.library_call "warp_tile_await_groups"
// CHECK-NEXT: warp.barrier
// CHECK: warp.library_call "warp_tile_factor_f32_16"
func.func @factor(%a: !warp.array<2 x f32>, %x: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64,
                warp.variant = #gpu} {
  %c0 = warp.constant 0 : si32
  %m = warp.tile_load %a[%c0, %c0] : !warp.array<2 x f32>, (si32, si32)
    -> !warp.tile<32x32 x f32>
  %l = warp.tile_cholesky %m : !warp.tile<32x32 x f32>
  %v = warp.tile_load %x[%c0] : !warp.array<1 x f32>, (si32)
    -> !warp.tile<32 x f32>
  %s = warp.tile_solve %l, %v : !warp.tile<32x32 x f32>, !warp.tile<32 x f32>
  warp.tile_store %s, %x[%c0] : !warp.tile<32 x f32>, !warp.array<1 x f32>,
    (si32)
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, rank = 2>

// So few elements come by the registers.
// CHECK-LABEL: func.func @other
// CHECK-NOT: fetch
// CHECK: warp.library_call "warp_tile_factor_f32_16"
func.func @other(%a: !warp.array<2 x f32>, %x: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64,
                warp.variant = #gpu} {
  %c0 = warp.constant 0 : si32
  %m = warp.tile_load %a[%c0, %c0] : !warp.array<2 x f32>, (si32, si32)
    -> !warp.tile<10x10 x f32>
  %v = warp.tile_load %x[%c0] : !warp.array<1 x f32>, (si32)
    -> !warp.tile<10 x f32>
  %l = warp.tile_cholesky %m : !warp.tile<10x10 x f32>
  %s = warp.tile_solve %l, %v : !warp.tile<10x10 x f32>, !warp.tile<10 x f32>
  warp.tile_store %s, %x[%c0] : !warp.tile<10 x f32>, !warp.array<1 x f32>,
    (si32)
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, rank = 2>

// Rows of 27 numbers do not begin at multiples of 16 bytes, and 6 runs are no
// divisor of 32 threads: such matrices are copied as well.
// CHECK-LABEL: func.func @ragged
// CHECK: warp.library_call "warp_tile_fetch_b32"
// CHECK: warp.library_call "warp_tile_fetch_b32"
// CHECK: warp.library_call "warp_tile_factor_f32_16"
func.func @ragged(%a: !warp.array<2 x f32>, %x: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64,
                warp.variant = #gpu} {
  %c0 = warp.constant 0 : si32
  %m = warp.tile_load %a[%c0, %c0] : !warp.array<2 x f32>, (si32, si32)
    -> !warp.tile<27x27 x f32>
  %n = warp.tile_load %a[%c0, %c0] : !warp.array<2 x f32>, (si32, si32)
    -> !warp.tile<24x24 x f32>
  %v = warp.tile_load %x[%c0] : !warp.array<1 x f32>, (si32)
    -> !warp.tile<27 x f32>
  %w = warp.tile_load %x[%c0] : !warp.array<1 x f32>, (si32)
    -> !warp.tile<24 x f32>
  %l = warp.tile_cholesky %m : !warp.tile<27x27 x f32>
  %k = warp.tile_cholesky %n : !warp.tile<24x24 x f32>
  %s = warp.tile_solve %l, %v : !warp.tile<27x27 x f32>, !warp.tile<27 x f32>
  %t = warp.tile_solve %k, %w : !warp.tile<24x24 x f32>, !warp.tile<24 x f32>
  warp.tile_store %s, %x[%c0] : !warp.tile<27 x f32>, !warp.array<1 x f32>,
    (si32)
  warp.tile_store %t, %x[%c0] : !warp.tile<24 x f32>, !warp.array<1 x f32>,
    (si32)
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, rank = 2>

// A step of a blocked factorisation: a product is taken from the panel where it
// lies, 32 threads have sums, and threads solve for a column each; no barrier
// within. Doubles do the same by other functions.
// CHECK-LABEL: func.func @panel
// CHECK: warp.library_call "warp_tile_take_f32_2x4_mn"
// CHECK: warp.library_call "warp_tile_multiply_f32_2x4_mn"({{.*}}, %[[YES:.*]]) :
// CHECK: warp.library_call "warp_tile_give_f32_2x4_mn"
// CHECK-NEXT: warp.barrier
// CHECK: warp.library_call "warp_tile_factor_f64_16"
// CHECK: warp.library_call "warp_tile_solve_columns_f32_16"
// CHECK: warp.library_call "warp_tile_solve_columns_f64_8"
// CHECK: warp.library_call "warp_tile_substitute_f64_1"
func.func @panel(%a: !warp.array<2 x f32>, %d: !warp.array<2 x f64>)
    attributes {warp.kernel, warp.block_threads = 32 : i64,
                warp.variant = #gpu} {
  %c0 = warp.constant 0 : si32
  %c8 = warp.constant 8 : si32
  %minus = warp.constant -1.0 : f32
  %x = warp.tile_load %a[%c0, %c0] : !warp.array<2 x f32>, (si32, si32)
    -> !warp.tile<16x16 x f32>
  %y = warp.tile_load %a[%c0, %c8] : !warp.array<2 x f32>, (si32, si32)
    -> !warp.tile<16x16 x f32>
  %s = warp.tile_load %a[%c8, %c8] : !warp.array<2 x f32>, (si32, si32)
    -> !warp.tile<16x16 x f32>
  %t = warp.tile_matmul %x transposed, %y add %s alpha %minus :
    !warp.tile<16x16 x f32>, !warp.tile<16x16 x f32> add
    !warp.tile<16x16 x f32> alpha f32 -> !warp.tile<16x16 x f32>
  %m = warp.tile_load %d[%c0, %c0] : !warp.array<2 x f64>, (si32, si32)
    -> !warp.tile<16x16 x f64>
  %l = warp.tile_cholesky %m : !warp.tile<16x16 x f64>
  %p = warp.tile_solve %x, %t : !warp.tile<16x16 x f32>,
    !warp.tile<16x16 x f32>
  warp.tile_store %p, %a[%c0, %c0] : !warp.tile<16x16 x f32>,
    !warp.array<2 x f32>, (si32, si32)
  %small = warp.tile_load %d[%c0, %c8] : !warp.array<2 x f64>, (si32, si32)
    -> !warp.tile<8x8 x f64>
  %sides = warp.tile_load %d[%c8, %c8] : !warp.array<2 x f64>, (si32, si32)
    -> !warp.tile<8x4 x f64>
  %q = warp.tile_solve %small, %sides : !warp.tile<8x8 x f64>,
    !warp.tile<8x4 x f64>
  warp.tile_store %q, %d[%c0, %c0] : !warp.tile<8x4 x f64>,
    !warp.array<2 x f64>, (si32, si32)
  %side = warp.tile_load %d[%c8, %c0] : !warp.array<2 x f64>, (si32, si32)
    -> !warp.tile<16x1 x f64>
  %r = warp.tile_solve %l, %side : !warp.tile<16x16 x f64>,
    !warp.tile<16x1 x f64>
  warp.tile_store %r, %d[%c0, %c0] : !warp.tile<16x1 x f64>,
    !warp.array<2 x f64>, (si32, si32)
  return
}

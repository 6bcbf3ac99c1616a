// RUN: warp-opt %s --split-input-file --warp-place-tiles | FileCheck %s

#gpu = #warp.variant<target = <name = "sm_90">, rank = 3>

// Sums stay with threads, and factors are loaded ahead: rows of the first, which
// threads read at a time, have room between them.
// CHECK-LABEL: func.func @product
// CHECK: warp.tile_splat {{.*}}storage = accumulators
// CHECK: scf.for
// CHECK: warp.tile_load %arg0{{.*}}pitch = 20, stages = 4
// CHECK: warp.tile_load %arg1{{.*}}pitch = 64, stages = 4
// CHECK: warp.tile_matmul {{.*}}warp.function = #warp.tile_function<name = "f32_8x4_kn", accumulators = "f32_8x4_kn", slots = 32>{{.*}}storage = accumulators
// CHECK: } {warp.stages = 4 : i64}
func.func @product(%a: !warp.array<2 x f32>, %b: !warp.array<2 x f32>,
                   %c: !warp.array<2 x f32>)
    attributes {warp.kernel, warp.block_threads = 128 : i64,
                warp.variant = #gpu} {
  %none = warp.constant 0.0 : f32
  %c0 = warp.constant 0 : si32
  %i0 = arith.constant 0 : i32
  %i1 = arith.constant 1 : i32
  %i8 = arith.constant 8 : i32
  %sums = warp.tile_splat %none : f32 -> !warp.tile<64x64 x f32>
  %made = scf.for %i = %i0 to %i8 step %i1 iter_args(%s = %sums)
      -> (!warp.tile<64x64 x f32>) : i32 {
    %k = warp.cast %i : i32 to si32
    %x = warp.tile_load %a[%c0, %k] : !warp.array<2 x f32>, (si32, si32)
      -> !warp.tile<64x16 x f32>
    %y = warp.tile_load %b[%k, %c0] : !warp.array<2 x f32>, (si32, si32)
      -> !warp.tile<16x64 x f32>
    %t = warp.tile_matmul %x, %y add %s : !warp.tile<64x16 x f32>,
      !warp.tile<16x64 x f32> add !warp.tile<64x64 x f32>
      -> !warp.tile<64x64 x f32>
    scf.yield %t : !warp.tile<64x64 x f32>
  }
  warp.tile_store %made, %c[%c0, %c0] : !warp.tile<64x64 x f32>,
    !warp.array<2 x f32>, (si32, si32)
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, rank = 3>

// Halves are multiplied by matrix instructions.
// CHECK-LABEL: func.func @halves
// CHECK: warp.tile_matmul {{.*}}warp.function = #warp.tile_function<name = "f16_32x16_kn", accumulators = "mma_32x16", slots = 16>
func.func @halves(%a: !warp.array<2 x f16>, %c: !warp.array<2 x f32>)
    attributes {warp.kernel, warp.block_threads = 64 : i64,
                warp.variant = #gpu} {
  %c0 = warp.constant 0 : si32
  %x = warp.tile_load %a[%c0, %c0] : !warp.array<2 x f16>, (si32, si32)
    -> !warp.tile<32x32 x f16>
  %t = warp.tile_matmul %x, %x : !warp.tile<32x32 x f16>,
    !warp.tile<32x32 x f16> -> !warp.tile<32x32 x f32>
  warp.tile_store %t, %c[%c0, %c0] : !warp.tile<32x32 x f32>,
    !warp.array<2 x f32>, (si32, si32)
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, rank = 3>

// Shapes that do not divide among threads have no form.
// CHECK-LABEL: func.func @odd
// CHECK-NOT: {form =
func.func @odd(%a: !warp.array<2 x f32>, %c: !warp.array<2 x f32>)
    attributes {warp.block_threads = 64 : i64, warp.variant = #gpu,
                warp.kernel} {
  %c0 = warp.constant 0 : si32
  %x = warp.tile_load %a[%c0, %c0] : !warp.array<2 x f32>, (si32, si32)
    -> !warp.tile<17x17 x f32>
  %t = warp.tile_matmul %x, %x : !warp.tile<17x17 x f32>,
    !warp.tile<17x17 x f32> -> !warp.tile<17x17 x f32>
  warp.tile_store %t, %c[%c0, %c0] : !warp.tile<17x17 x f32>,
    !warp.array<2 x f32>, (si32, si32)
  return
}

// -----

#old = #warp.variant<target = <name = "sm_75">, rank = 3>

// Older processors have no matrix instructions of that shape, and no
// asynchronous copies.
// CHECK-LABEL: func.func @old
// CHECK-NOT: {form =
func.func @old(%a: !warp.array<2 x f16>, %c: !warp.array<2 x f32>)
    attributes {warp.kernel, warp.block_threads = 64 : i64,
                warp.variant = #old} {
  %c0 = warp.constant 0 : si32
  %x = warp.tile_load %a[%c0, %c0] : !warp.array<2 x f16>, (si32, si32)
    -> !warp.tile<32x32 x f16>
  %t = warp.tile_matmul %x, %x : !warp.tile<32x32 x f16>,
    !warp.tile<32x32 x f16> -> !warp.tile<32x32 x f32>
  warp.tile_store %t, %c[%c0, %c0] : !warp.tile<32x32 x f32>,
    !warp.array<2 x f32>, (si32, si32)
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, rank = 2>

// Matrices that only factors and solves read have room between their rows.
// CHECK-LABEL: func.func @factor
// CHECK: warp.tile_load {{.*}}pitch = 20
// CHECK: warp.tile_cholesky {{.*}}warp.function = #warp.tile_function<name = "16">{{.*}}pitch = 20
// CHECK: warp.tile_solve {{.*}}warp.function = #warp.tile_function<name = "1">
func.func @factor(%a: !warp.array<2 x f32>, %x: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64,
                warp.variant = #gpu} {
  %c0 = warp.constant 0 : si32
  %m = warp.tile_load %a[%c0, %c0] : !warp.array<2 x f32>, (si32, si32)
    -> !warp.tile<16x16 x f32>
  %v = warp.tile_load %x[%c0] : !warp.array<1 x f32>, (si32)
    -> !warp.tile<16 x f32>
  %l = warp.tile_cholesky %m : !warp.tile<16x16 x f32>
  %s = warp.tile_solve %l, %v : !warp.tile<16x16 x f32>, !warp.tile<16 x f32>
  warp.tile_store %s, %x[%c0] : !warp.tile<16 x f32>, !warp.array<1 x f32>,
    (si32)
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, rank = 2>

// Values that two loops treat element by element stay in registers.
// CHECK-LABEL: func.func @stripes
// CHECK: warp.tile_load {{.*}}storage = distributed
func.func @stripes(%a: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64,
                warp.variant = #gpu} {
  %c0 = warp.constant 0 : si32
  %t = warp.tile_load %a[%c0] : !warp.array<1 x f32>, (si32)
    -> !warp.tile<64 x f32>
  %s = warp.tile_reduce add %t : !warp.tile<64 x f32> -> !warp.tile<1 x f32>
  warp.tile_store %s, %a[%c0] : !warp.tile<1 x f32>, !warp.array<1 x f32>,
    (si32)
  warp.tile_store %t, %a[%c0] : !warp.tile<64 x f32>, !warp.array<1 x f32>,
    (si32)
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, rank = 2>

// Loads for a store precede all parts of the store.
// CHECK-LABEL: func.func @copy
// CHECK: warp.tile_load
// CHECK-NOT: inline
// CHECK-SAME: storage = distributed
func.func @copy(%a: !warp.array<1 x f32>, %b: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64,
                warp.variant = #gpu} {
  %c0 = warp.constant 0 : si32
  %t = warp.tile_load %a[%c0] : !warp.array<1 x f32>, (si32)
    -> !warp.tile<64 x f32>
  warp.tile_store %t, %b[%c0] : !warp.tile<64 x f32>, !warp.array<1 x f32>,
    (si32)
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, rank = 2>

// Sums are added to an array from where they are, and several results of one
// function of elements are in registers together.
// CHECK-LABEL: func.func @added
// CHECK: warp.tile_matmul {{.*}}warp.function = #warp.tile_function<name = "f32_4x4_kn", accumulators = "f32_4x4_kn", slots = 16>, warp.layout = #warp.tile_layout<storage = accumulators>
// CHECK: warp.tile_map
// CHECK: {warp.layout = #warp.tile_layout<storage = distributed>}
// CHECK: warp.tile_atomic add
func.func @added(%a: !warp.array<2 x f32>, %c: !warp.array<2 x f32>,
                 %d: !warp.array<2 x f32>)
    attributes {warp.kernel, warp.block_threads = 64 : i64,
                warp.variant = #gpu} {
  %c0 = warp.constant 0 : si32
  %x = warp.tile_load %a[%c0, %c0] : !warp.array<2 x f32>, (si32, si32)
    -> !warp.tile<32x32 x f32>
  %t = warp.tile_matmul %x, %x : !warp.tile<32x32 x f32>,
    !warp.tile<32x32 x f32> -> !warp.tile<32x32 x f32>
  %dc = warp.grad %c : !warp.array<2 x f32> -> !warp.array<2 x f32>
  %old = warp.tile_atomic add %t, %dc[%c0, %c0] : !warp.tile<32x32 x f32>,
    !warp.array<2 x f32>, (si32, si32) -> !warp.tile<32x32 x f32>
  %y = warp.tile_load %d[%c0, %c0] : !warp.array<2 x f32>, (si32, si32)
    -> !warp.tile<16x64 x f32>
  %both:2 = warp.tile_map(%y) {
  ^bb0(%e: f32):
    %n = warp.neg(%e) : (f32) -> f32
    %s = warp.mul(%e, %e) : (f32, f32) -> f32
    warp.tile_yield %n, %s : f32, f32
  } : (!warp.tile<16x64 x f32>) -> (!warp.tile<16x64 x f32>,
                                    !warp.tile<16x64 x f32>)
  %m = warp.tile_reduce max %both#0 : !warp.tile<16x64 x f32>
    -> !warp.tile<1 x f32>
  warp.tile_store %both#1, %d[%c0, %c0] : !warp.tile<16x64 x f32>,
    !warp.array<2 x f32>, (si32, si32)
  %v = warp.view %a[%c0] : !warp.array<2 x f32>, si32 -> !warp.array<1 x f32>
  %u = warp.tile_atomic add %m, %v[%c0] : !warp.tile<1 x f32>,
    !warp.array<1 x f32>, (si32) -> !warp.tile<1 x f32>
  return
}

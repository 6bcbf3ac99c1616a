// RUN: warp-opt %s --split-input-file --warp-apply-schedules=stage=tiles | FileCheck %s

#variant = #warp.variant<target = <name = "sm_90a">, rank = 3, block_dim = 128, max_block_coarsening = 4>

// The second factor, the sums and what is stored become wider, the first factor
// stays; sums that go to other functions need memory, so that two blocks are one
// where four may be.
// CHECK-LABEL: func @product(
// CHECK-SAME: warp.schedule = #warp.schedule<block_coarsening = 2, size_facts = 16>
// CHECK: %[[SIXTY_FOUR:.*]] = warp.constant 64 : si32
// CHECK: %[[PLACE:.*]]:2 = warp.tid
// CHECK: %[[ROW:.*]] = warp.mul(%[[PLACE]]#0, %[[SIXTY_FOUR]])
// CHECK: %[[WIDTH:.*]] = warp.constant 128 : si32
// CHECK: %[[COLUMN:.*]] = warp.mul(%[[PLACE]]#1, %[[WIDTH]])
// CHECK: %[[ZERO:.*]] = warp.tile_splat %{{.*}} : f32 -> !warp.tile<64x128 x f32>
// CHECK: %[[SUMS:.*]] = scf.for {{.*}} -> (!warp.tile<64x128 x f32>)
// CHECK: warp.tile_load %{{.*}}[%[[ROW]], %{{.*}}] : {{.*}} -> !warp.tile<64x32 x f16>
// CHECK: warp.tile_load %{{.*}}[%{{.*}}, %[[COLUMN]]] : {{.*}} -> !warp.tile<32x128 x f16>
// CHECK: warp.tile_map(%[[SUMS]]
// CHECK: warp.tile_store %{{.*}}, %{{.*}}[%[[ROW]], %[[COLUMN]]] : !warp.tile<64x128 x f32>
// CHECK: warp.tile_atomic add %[[SUMS]], %{{.*}}[%[[ROW]], %[[COLUMN]]] : !warp.tile<64x128 x f32>
func.func @product(%a: !warp.array<2 x f16>, %b: !warp.array<2 x f16>,
                   %c: !warp.array<2 x f32>, %d: !warp.array<2 x f32>)
    attributes {warp.kernel, warp.block_threads = 128 : i64, warp.variant = #variant} {
  %none = warp.constant 0.0 : f32
  %two = warp.constant 2.0 : f32
  %c32 = warp.constant 32 : si32
  %c64 = warp.constant 64 : si32
  %i0 = arith.constant 0 : i32
  %i1 = arith.constant 1 : i32
  %i8 = arith.constant 8 : i32
  %place:2 = warp.tid : si32, si32
  %row = warp.mul(%place#0, %c64) : (si32, si32) -> si32
  %column = warp.mul(%place#1, %c64) : (si32, si32) -> si32
  %sums = warp.tile_splat %none : f32 -> !warp.tile<64x64 x f32>
  %made = scf.for %i = %i0 to %i8 step %i1 iter_args(%s = %sums)
      -> (!warp.tile<64x64 x f32>) : i32 {
    %step = warp.cast %i : i32 to si32
    %k = warp.mul(%step, %c32) : (si32, si32) -> si32
    %x = warp.tile_load %a[%row, %k] : !warp.array<2 x f16>, (si32, si32)
      -> !warp.tile<64x32 x f16>
    %y = warp.tile_load %b[%k, %column] : !warp.array<2 x f16>, (si32, si32)
      -> !warp.tile<32x64 x f16>
    %t = warp.tile_matmul %x, %y add %s : !warp.tile<64x32 x f16>,
      !warp.tile<32x64 x f16> add !warp.tile<64x64 x f32>
      -> !warp.tile<64x64 x f32>
    scf.yield %t : !warp.tile<64x64 x f32>
  }
  %twice = warp.tile_map(%made, %two) {
  ^bb0(%x: f32, %y: f32):
    %p = warp.mul(%x, %y) : (f32, f32) -> f32
    warp.tile_yield %p : f32
  } : (!warp.tile<64x64 x f32>, f32) -> !warp.tile<64x64 x f32>
  warp.tile_store %twice, %c[%row, %column] : !warp.tile<64x64 x f32>,
    !warp.array<2 x f32>, (si32, si32)
  %old = warp.tile_atomic add %made, %d[%row, %column] : !warp.tile<64x64 x f32>,
    !warp.array<2 x f32>, (si32, si32) -> !warp.tile<64x64 x f32>
  return
}

// -----

#variant = #warp.variant<target = <name = "sm_90a">, rank = 3, block_dim = 128, max_block_coarsening = 4>

// A thread has 64 floats at most; rows of a factor that is turned are columns.
// CHECK-LABEL: func @turned(
func.func @turned(%a: !warp.array<2 x f32>, %b: !warp.array<2 x f32>,
                %c: !warp.array<2 x f32>)
    attributes {warp.kernel, warp.block_threads = 128 : i64, warp.variant = #variant} {
  %none = warp.constant 0.0 : f32
  %c8 = warp.constant 8 : si32
  %c32 = warp.constant 32 : si32
  %c64 = warp.constant 64 : si32
  %i0 = arith.constant 0 : i32
  %i1 = arith.constant 1 : i32
  %i8 = arith.constant 8 : i32
  %place:2 = warp.tid : si32, si32
  %row = warp.mul(%place#0, %c64) : (si32, si32) -> si32
  %column = warp.mul(%place#1, %c64) : (si32, si32) -> si32
  %sums = warp.tile_splat %none : f32 -> !warp.tile<64x64 x f32>
  %made = scf.for %i = %i0 to %i8 step %i1 iter_args(%s = %sums)
      -> (!warp.tile<64x64 x f32>) : i32 {
    %step = warp.cast %i : i32 to si32
    %k = warp.mul(%step, %c32) : (si32, si32) -> si32
    %x = warp.tile_load %a[%row, %k] : !warp.array<2 x f32>, (si32, si32)
      -> !warp.tile<64x32 x f32>
    // CHECK: warp.tile_load {{.*}} -> !warp.tile<128x32 x f32>
    // CHECK: warp.tile_transpose {{.*}} -> !warp.tile<32x128 x f32>
    %z = warp.tile_load %b[%column, %k] : !warp.array<2 x f32>, (si32, si32)
      -> !warp.tile<64x32 x f32>
    %y = warp.tile_transpose %z, [1, 0] : !warp.tile<64x32 x f32> -> !warp.tile<32x64 x f32>
    %t = warp.tile_matmul %x, %y add %s : !warp.tile<64x32 x f32>,
      !warp.tile<32x64 x f32> add !warp.tile<64x64 x f32>
      -> !warp.tile<64x64 x f32>
    scf.yield %t : !warp.tile<64x64 x f32>
  }
  warp.tile_store %made, %c[%row, %column] : !warp.tile<64x64 x f32>,
    !warp.array<2 x f32>, (si32, si32)
  return
}

// -----

#variant = #warp.variant<target = <name = "sm_90a">, rank = 3, block_dim = 128, max_block_coarsening = 1>

// Launches of few blocks keep them, and code says that it depends on that.
// CHECK-LABEL: func @few(
func.func @few(%a: !warp.array<2 x f16>, %b: !warp.array<2 x f16>,
                %c: !warp.array<2 x f32>)
    attributes {warp.kernel, warp.block_threads = 128 : i64, warp.variant = #variant} {
  %none = warp.constant 0.0 : f32
  %c8 = warp.constant 8 : si32
  %c32 = warp.constant 32 : si32
  %c64 = warp.constant 64 : si32
  %i0 = arith.constant 0 : i32
  %i1 = arith.constant 1 : i32
  %i8 = arith.constant 8 : i32
  %place:2 = warp.tid : si32, si32
  %row = warp.mul(%place#0, %c64) : (si32, si32) -> si32
  %column = warp.mul(%place#1, %c64) : (si32, si32) -> si32
  // CHECK-SAME: warp.schedule = #warp.schedule<size_facts = 16>
  // CHECK: warp.tile_matmul {{.*}} -> !warp.tile<64x64 x f32>
  %sums = warp.tile_splat %none : f32 -> !warp.tile<64x64 x f32>
  %made = scf.for %i = %i0 to %i8 step %i1 iter_args(%s = %sums)
      -> (!warp.tile<64x64 x f32>) : i32 {
    %step = warp.cast %i : i32 to si32
    %k = warp.mul(%step, %c32) : (si32, si32) -> si32
    %x = warp.tile_load %a[%row, %k] : !warp.array<2 x f16>, (si32, si32)
      -> !warp.tile<64x32 x f16>
    %y = warp.tile_load %b[%k, %column] : !warp.array<2 x f16>, (si32, si32)
      -> !warp.tile<32x64 x f16>
    %t = warp.tile_matmul %x, %y add %s : !warp.tile<64x32 x f16>,
      !warp.tile<32x64 x f16> add !warp.tile<64x64 x f32>
      -> !warp.tile<64x64 x f32>
    scf.yield %t : !warp.tile<64x64 x f32>
  }
  warp.tile_store %made, %c[%row, %column] : !warp.tile<64x64 x f32>,
    !warp.array<2 x f32>, (si32, si32)
  return
}

// -----

#variant = #warp.variant<target = <name = "sm_90a">, rank = 3, block_dim = 128, max_block_coarsening = 4>

// Uses of the block index are done by each joined block.
// CHECK-LABEL: func @elsewhere(
func.func @elsewhere(%a: !warp.array<2 x f16>, %b: !warp.array<2 x f16>,
                %c: !warp.array<2 x f32>)
    attributes {warp.kernel, warp.block_threads = 128 : i64, warp.variant = #variant} {
  %none = warp.constant 0.0 : f32
  %c8 = warp.constant 8 : si32
  %c32 = warp.constant 32 : si32
  %c64 = warp.constant 64 : si32
  %i0 = arith.constant 0 : i32
  %i1 = arith.constant 1 : i32
  %i8 = arith.constant 8 : i32
  %place:2 = warp.tid : si32, si32
  %row = warp.mul(%place#0, %c64) : (si32, si32) -> si32
  %column = warp.mul(%place#1, %c64) : (si32, si32) -> si32
  // CHECK: warp.tile_matmul {{.*}} -> !warp.tile<64x64 x f32>
  // CHECK-NOT: joined
  %other = warp.add(%column, %c8) : (si32, si32) -> si32
  %sums = warp.tile_splat %none : f32 -> !warp.tile<64x64 x f32>
  %made = scf.for %i = %i0 to %i8 step %i1 iter_args(%s = %sums)
      -> (!warp.tile<64x64 x f32>) : i32 {
    %step = warp.cast %i : i32 to si32
    %k = warp.mul(%step, %c32) : (si32, si32) -> si32
    %x = warp.tile_load %a[%row, %k] : !warp.array<2 x f16>, (si32, si32)
      -> !warp.tile<64x32 x f16>
    %y = warp.tile_load %b[%k, %column] : !warp.array<2 x f16>, (si32, si32)
      -> !warp.tile<32x64 x f16>
    %t = warp.tile_matmul %x, %y add %s : !warp.tile<64x32 x f16>,
      !warp.tile<32x64 x f16> add !warp.tile<64x64 x f32>
      -> !warp.tile<64x64 x f32>
    scf.yield %t : !warp.tile<64x64 x f32>
  }
  warp.tile_store %made, %c[%row, %other] : !warp.tile<64x64 x f32>,
    !warp.array<2 x f32>, (si32, si32)
  return
}

// -----

#variant = #warp.variant<target = <name = "sm_90a">, rank = 3, block_dim = 128, max_block_coarsening = 4>

// Blocks that store the same tile do so each.
// CHECK-LABEL: func @repeated(
func.func @repeated(%a: !warp.array<2 x f16>, %b: !warp.array<2 x f16>,
                %c: !warp.array<2 x f32>)
    attributes {warp.kernel, warp.block_threads = 128 : i64, warp.variant = #variant} {
  %none = warp.constant 0.0 : f32
  %c8 = warp.constant 8 : si32
  %c32 = warp.constant 32 : si32
  %c64 = warp.constant 64 : si32
  %i0 = arith.constant 0 : i32
  %i1 = arith.constant 1 : i32
  %i8 = arith.constant 8 : i32
  %place:2 = warp.tid : si32, si32
  %row = warp.mul(%place#0, %c64) : (si32, si32) -> si32
  %column = warp.mul(%place#1, %c64) : (si32, si32) -> si32
  // CHECK: warp.tile_matmul {{.*}} -> !warp.tile<64x64 x f32>
  %sums = warp.tile_splat %none : f32 -> !warp.tile<64x64 x f32>
  %made = scf.for %i = %i0 to %i8 step %i1 iter_args(%s = %sums)
      -> (!warp.tile<64x64 x f32>) : i32 {
    %step = warp.cast %i : i32 to si32
    %k = warp.mul(%step, %c32) : (si32, si32) -> si32
    %x = warp.tile_load %a[%row, %k] : !warp.array<2 x f16>, (si32, si32)
      -> !warp.tile<64x32 x f16>
    %y = warp.tile_load %b[%k, %column] : !warp.array<2 x f16>, (si32, si32)
      -> !warp.tile<32x64 x f16>
    %t = warp.tile_matmul %x, %y add %s : !warp.tile<64x32 x f16>,
      !warp.tile<32x64 x f16> add !warp.tile<64x64 x f32>
      -> !warp.tile<64x64 x f32>
    scf.yield %t : !warp.tile<64x64 x f32>
  }
  warp.tile_store %made, %c[%row, %column] : !warp.tile<64x64 x f32>,
    !warp.array<2 x f32>, (si32, si32)
  warp.tile_store %sums, %c[%row, %row] : !warp.tile<64x64 x f32>,
    !warp.array<2 x f32>, (si32, si32)
  return
}

// -----

#variant = #warp.variant<target = <name = "sm_90a">, rank = 3, block_dim = 128, max_block_coarsening = 4>

// Tiles that are wider than the step between blocks overlap.
// CHECK-LABEL: func @part(
func.func @part(%a: !warp.array<2 x f16>, %b: !warp.array<2 x f16>,
                %c: !warp.array<2 x f32>)
    attributes {warp.kernel, warp.block_threads = 128 : i64, warp.variant = #variant} {
  %none = warp.constant 0.0 : f32
  %c8 = warp.constant 8 : si32
  %c32 = warp.constant 32 : si32
  %c64 = warp.constant 64 : si32
  %i0 = arith.constant 0 : i32
  %i1 = arith.constant 1 : i32
  %i8 = arith.constant 8 : i32
  %place:2 = warp.tid : si32, si32
  %row = warp.mul(%place#0, %c64) : (si32, si32) -> si32
  %column = warp.mul(%place#1, %c64) : (si32, si32) -> si32
  %wide = warp.mul(%place#1, %c32) : (si32, si32) -> si32
  // CHECK: warp.tile_matmul {{.*}} -> !warp.tile<64x64 x f32>
  %sums = warp.tile_splat %none : f32 -> !warp.tile<64x64 x f32>
  %made = scf.for %i = %i0 to %i8 step %i1 iter_args(%s = %sums)
      -> (!warp.tile<64x64 x f32>) : i32 {
    %step = warp.cast %i : i32 to si32
    %k = warp.mul(%step, %c32) : (si32, si32) -> si32
    %x = warp.tile_load %a[%row, %k] : !warp.array<2 x f16>, (si32, si32)
      -> !warp.tile<64x32 x f16>
    %y = warp.tile_load %b[%k, %column] : !warp.array<2 x f16>, (si32, si32)
      -> !warp.tile<32x64 x f16>
    %t = warp.tile_matmul %x, %y add %s : !warp.tile<64x32 x f16>,
      !warp.tile<32x64 x f16> add !warp.tile<64x64 x f32>
      -> !warp.tile<64x64 x f32>
    scf.yield %t : !warp.tile<64x64 x f32>
  }
  warp.tile_store %made, %c[%row, %wide] : !warp.tile<64x64 x f32>,
    !warp.array<2 x f32>, (si32, si32)
  return
}

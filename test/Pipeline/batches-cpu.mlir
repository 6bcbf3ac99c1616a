// REQUIRES: x86-64
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-gpu target=cpu:x86-64-v4" | FileCheck %s

// Sixteen blocks load their systems, one call solves them, sixteen blocks store. The factor stays
// where the library has it: nothing else asks for it.
// CHECK-LABEL: llvm.func @solve(
// CHECK-SAME: warp.choices = {{.*}}["blocks", "16", "their small systems are lanes of vectors", 0]
// CHECK: scf.for %[[FIRST:.*]] = %arg1 to %arg2 step %[[WIDTH:.*]] : i64
// CHECK: %[[LEFT:.*]] = arith.subi %arg2, %[[FIRST]]
// CHECK: %[[COUNT:.*]] = arith.minsi %[[LEFT]], %[[WIDTH]]
// CHECK: scf.for %{{.*}} to %[[COUNT]] step
// CHECK: %[[NARROW:.*]] = arith.trunci %[[COUNT]]
// CHECK: %[[STEPS:.*]] = arith.constant 25 : i32
// CHECK: llvm.call @warp_tile_systems_f32({{.*}}, %[[NARROW]], {{.*}}, %[[STEPS]], %{{.*}})
// CHECK: scf.for %{{.*}} to %[[COUNT]] step
// CHECK-NOT: llvm.call
func.func @solve(%a: !warp.array<3 x f32>, %b: !warp.array<2 x f32>)
    attributes {warp.kernel, warp.block_threads = 1 : i64} {
  %c0 = warp.constant 0 : si32
  %i = warp.tid : si32
  %mine = warp.view %a[%i] : !warp.array<3 x f32>, si32 -> !warp.array<2 x f32>
  %m = warp.tile_load %mine[%c0, %c0] : !warp.array<2 x f32>, (si32, si32)
    -> !warp.tile<16x16 x f32>
  %side = warp.view %b[%i] : !warp.array<2 x f32>, si32 -> !warp.array<1 x f32>
  %v = warp.tile_load %side[%c0] : !warp.array<1 x f32>, (si32)
    -> !warp.tile<16 x f32>
  %l = warp.tile_cholesky %m : !warp.tile<16x16 x f32>
  %y = warp.tile_solve %l, %v : !warp.tile<16x16 x f32>, !warp.tile<16 x f32>
  %x = warp.tile_solve %l transposed, %y : !warp.tile<16x16 x f32>,
    !warp.tile<16 x f32>
  warp.tile_store %x, %side[%c0] : !warp.tile<16 x f32>, !warp.array<1 x f32>,
    (si32)
  return
}

// -----

// A number that a block has from its array for later is kept beside its tiles.
// The factor is asked for.
// CHECK-LABEL: llvm.func @keeps(
// CHECK: scf.for
// CHECK: %[[S:.*]] = llvm.load {{.*}} : !llvm.ptr -> f32
// CHECK: llvm.store %[[S]], %[[PLACE:.*]] {{.*}} : f32, !llvm.ptr
// CHECK: arith.constant 5 : i32
// CHECK: llvm.call @warp_tile_systems_f32
// CHECK: scf.for
// CHECK: llvm.load {{.*}} : !llvm.ptr -> f32
func.func @keeps(%a: !warp.array<3 x f32>, %b: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 1 : i64} {
  %c0 = warp.constant 0 : si32
  %i = warp.tid : si32
  %mine = warp.view %a[%i] : !warp.array<3 x f32>, si32 -> !warp.array<2 x f32>
  %m = warp.tile_load %mine[%c0, %c0] : !warp.array<2 x f32>, (si32, si32)
    -> !warp.tile<16x16 x f32>
  %s = warp.load %b[%i] : !warp.array<1 x f32>, si32 -> f32
  %l = warp.tile_cholesky %m : !warp.tile<16x16 x f32>
  warp.tile_store %l, %mine[%c0, %c0] : !warp.tile<16x16 x f32>,
    !warp.array<2 x f32>, (si32, si32)
  warp.store %s, %b[%c0] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// There are more rows than lanes pay for.
// CHECK-LABEL: llvm.func @large(
// CHECK-NOT: warp_tile_systems
// CHECK: llvm.call @warp_tile_cholesky_f32
func.func @large(%a: !warp.array<3 x f32>)
    attributes {warp.kernel, warp.block_threads = 1 : i64} {
  %c0 = warp.constant 0 : si32
  %i = warp.tid : si32
  %mine = warp.view %a[%i] : !warp.array<3 x f32>, si32 -> !warp.array<2 x f32>
  %m = warp.tile_load %mine[%c0, %c0] : !warp.array<2 x f32>, (si32, si32)
    -> !warp.tile<33x33 x f32>
  %l = warp.tile_cholesky %m : !warp.tile<33x33 x f32>
  warp.tile_store %l, %mine[%c0, %c0] : !warp.tile<33x33 x f32>,
    !warp.array<2 x f32>, (si32, si32)
  return
}

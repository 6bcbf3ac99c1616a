// RUN: warp-opt %s --split-input-file --warp-pipeline="to-gpu target=sm_90 rank=2 packed=3 disjoint=true" | FileCheck %s
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-gpu target=sm_90 rank=2 packed=3 disjoint=true block-dim=64" | FileCheck %s --check-prefix=NARROW

// A store with the indices exchanged: a thread loads four elements of a column,
// the block waits, and the thread stores four of a row.
// CHECK-LABEL: gpu.func @turn(
// CHECK-SAME: workgroup({{.*}} : memref<4224xi8
// CHECK-SAME: transpose_tile = 32
// CHECK-COUNT-4: llvm.load {{.*}} : !llvm.ptr<1> -> f32
// CHECK-COUNT-4: llvm.store {{.*}} : f32, !llvm.ptr<3>
// CHECK: gpu.barrier
// CHECK-COUNT-4: llvm.load {{.*}} : !llvm.ptr<3> -> f32
// CHECK-COUNT-4: llvm.store {{.*}} : f32, !llvm.ptr<1>
// CHECK: scf.for
// CHECK: llvm.load {{.*}} : !llvm.ptr<1> -> f32
// CHECK: llvm.store {{.*}} : f32, !llvm.ptr<1>
// Blocks of two warps have no squares.
// NARROW-LABEL: gpu.func @turn(
// NARROW-NOT: tile =
// NARROW-NOT: gpu.barrier
func.func @turn(%a: !warp.array<2 x f32>, %b: !warp.array<2 x f32>)
    attributes {warp.kernel} {
  %i, %j = warp.tid : si32, si32
  %v = warp.load %a[%i, %j] : !warp.array<2 x f32>, si32, si32 -> f32
  warp.store %v, %b[%j, %i] : f32, !warp.array<2 x f32>, si32, si32
  return
}

// -----

// An adjoint clears what it loads: the squares are used twice.
// CHECK-LABEL: gpu.func @clear(
// CHECK-SAME: transpose_tile = 32
// CHECK-COUNT-3: gpu.barrier
// CHECK-NOT: gpu.barrier
func.func @clear(%a: !warp.array<2 x f32>, %b: !warp.array<2 x f32>)
    attributes {warp.kernel} {
  %i, %j = warp.tid : si32, si32
  %zero = warp.constant 0.0 : f32
  %v = warp.load %b[%j, %i] : !warp.array<2 x f32>, si32, si32 -> f32
  %w = warp.load %a[%i, %j] : !warp.array<2 x f32>, si32, si32 -> f32
  %s = warp.add(%v, %w) : (f32, f32) -> f32
  warp.store %s, %a[%i, %j] : f32, !warp.array<2 x f32>, si32, si32
  warp.store %zero, %b[%j, %i] : f32, !warp.array<2 x f32>, si32, si32
  return
}

// -----

// Another thread of the block would load before this one has stored.
// CHECK-LABEL: gpu.func @load_after_store(
// CHECK-NOT: tile =
// CHECK-NOT: gpu.barrier
func.func @load_after_store(%a: !warp.array<2 x f32>, %b: !warp.array<2 x f32>)
    attributes {warp.kernel} {
  %i, %j = warp.tid : si32, si32
  %v = warp.load %a[%i, %j] : !warp.array<2 x f32>, si32, si32 -> f32
  warp.store %v, %b[%i, %j] : f32, !warp.array<2 x f32>, si32, si32
  %w = warp.load %b[%j, %i] : !warp.array<2 x f32>, si32, si32 -> f32
  warp.store %w, %a[%i, %j] : f32, !warp.array<2 x f32>, si32, si32
  return
}

// -----

// Nothing is exchanged: lines are whole already.
// CHECK-LABEL: gpu.func @straight(
// CHECK-NOT: tile =
// CHECK-NOT: gpu.barrier
func.func @straight(%a: !warp.array<2 x f32>, %b: !warp.array<2 x f32>)
    attributes {warp.kernel} {
  %i, %j = warp.tid : si32, si32
  %v = warp.load %a[%i, %j] : !warp.array<2 x f32>, si32, si32 -> f32
  warp.store %v, %b[%i, %j] : f32, !warp.array<2 x f32>, si32, si32
  return
}

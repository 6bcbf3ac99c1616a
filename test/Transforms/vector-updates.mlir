// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm contiguous=1 threads=1" | FileCheck %s

// Neighbouring threads update neighbouring elements: lanes of one update do not
// meet, so it belongs to the loop that may be vectorised.
// CHECK-LABEL: llvm.func @neighbours
// CHECK-SAME: #warp.recipe<{{.*}}exclusive = true
// CHECK: llvm.load {{.*}}access_groups
// CHECK: llvm.store {{.*}}access_groups
func.func @neighbours(%x: !warp.array<1 x f32>, %v: f32)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %one = warp.constant 1 : si32
  %after = warp.add(%i, %one) : (si32, si32) -> si32
  %old = warp.atomic add %v, %x[%after] : f32, !warp.array<1 x f32>, si32 -> f32
  return
}

// -----

// Index -1 is the last element, which another thread of the same vector may
// update.
// CHECK-LABEL: llvm.func @wrapped
// CHECK-SAME: #warp.recipe<{{.*}}exclusive = true
// CHECK-NOT: access_groups
// CHECK: llvm.return
func.func @wrapped(%x: !warp.array<1 x f32>, %v: f32)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %one = warp.constant 1 : si32
  %before = warp.sub(%i, %one) : (si32, si32) -> si32
  %old = warp.atomic add %v, %x[%before]
    : f32, !warp.array<1 x f32>, si32 -> f32
  return
}

// -----

// So does half the index.
// CHECK-LABEL: llvm.func @same
// CHECK-SAME: #warp.recipe<{{.*}}exclusive = true
// CHECK-NOT: access_groups
// CHECK: llvm.return
func.func @same(%x: !warp.array<1 x f32>, %v: f32) attributes {warp.kernel} {
  %i = warp.tid : si32
  %two = warp.constant 2 : si32
  %half = warp.div(%i, %two) : (si32, si32) -> si32
  %old = warp.atomic add %v, %x[%half] : f32, !warp.array<1 x f32>, si32 -> f32
  return
}

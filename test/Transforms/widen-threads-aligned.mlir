// REQUIRES: x86-64
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-launch disjoint target=cpu:x86-64-v4" | FileCheck %s
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-gpu disjoint target=cpu:x86-64-v4" | FileCheck %s --check-prefix=ENTRY

// Sixteen threads have the same quotient by 16 if the index of the first is a
// multiple of 16; then they load what it leads to once.
// CHECK-LABEL: func.func @tiles
// CHECK: warp.threads attributes {{.*}}lanes = 16 : i64{{.*}}warp.aligned
// CHECK: ^bb0(%[[I:.*]]: i32, %{{.*}}: vector<16xi1>):
// CHECK: %[[TILE:.*]] = arith.shrsi %[[I]], %{{.*}} : i32
// CHECK: %[[AT:.*]] = arith.addi %[[TILE]], %{{.*}} : i32
// CHECK: warp.load_components %{{.*}}[%[[AT]]]

// A range may begin in the middle of a vector.
// ENTRY-LABEL: llvm.func @tiles
// ENTRY-SAME: (%{{.*}}: !llvm.ptr{{.*}}, %[[BEGIN:[a-z0-9]+]]: i64, %{{.*}}: i64)
// ENTRY: %[[END:.*]] = arith.maxsi %[[BEGIN]]
// ENTRY: %[[FIRST:.*]] = arith.andi %[[BEGIN]], %{{.*}} : i64
// ENTRY: %[[PART:.*]] = arith.cmpi slt, %[[FIRST]], %[[BEGIN]]
// ENTRY: %[[SOME:.*]] = arith.cmpi slt, %[[BEGIN]], %[[END]]
// ENTRY: %[[BOTH:.*]] = arith.andi %[[PART]], %[[SOME]]
// ENTRY: scf.if %[[BOTH]]
// ENTRY: scf.for
// ENTRY: scf.if
func.func @tiles(%x: !warp.array<1 x f32>, %weight: !warp.array<1 x f32>,
                 %y: !warp.array<1 x f32>) attributes {warp.kernel} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %c64 = arith.constant 64 : i32
  %sixteen = warp.constant 16 : si32
  %zero = warp.constant 0.0 : f32
  %i = warp.tid : si32
  %tile = warp.floordiv(%i, %sixteen) : (si32, si32) -> si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %r = scf.for %k = %c0 to %c64 step %c1 iter_args(%s = %zero) -> (f32) : i32 {
    %d = warp.cast %k : i32 to si32
    %j = warp.add(%tile, %d) : (si32, si32) -> si32
    %w = warp.load %weight[%j] : !warp.array<1 x f32>, si32 -> f32
    %p = warp.mul(%w, %v) : (f32, f32) -> f32
    %t = warp.add(%s, %p) : (f32, f32) -> f32
    scf.yield %t : f32
  }
  warp.store %r, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// Tiles of 5 threads have no vector in common.
// CHECK-LABEL: func.func @fives
// CHECK-NOT: warp.aligned
// CHECK: return
func.func @fives(%x: !warp.array<1 x f32>, %weight: !warp.array<1 x f32>,
                 %y: !warp.array<1 x f32>) attributes {warp.kernel} {
  %five = warp.constant 5 : si32
  %i = warp.tid : si32
  %tile = warp.floordiv(%i, %five) : (si32, si32) -> si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %w = warp.load %weight[%tile] : !warp.array<1 x f32>, si32 -> f32
  %p = warp.mul(%w, %v) : (f32, f32) -> f32
  %q = warp.sin(%p) : (f32) -> f32
  warp.store %q, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

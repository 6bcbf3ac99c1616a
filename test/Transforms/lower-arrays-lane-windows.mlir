// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm target=cpu packed=255 non-negative=255 disjoint lanes=8" | FileCheck %s
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm target=cpu packed=255 non-negative=255 disjoint lanes=8 deterministic" | FileCheck %s --check-prefix=ORDER

// In a deterministic launch updates keep their order.
// ORDER-NOT: llvm.shufflevector {{.*}} [7, 8, 9, 10, 11, 12, 13, 14]

// Three updates whose elements overlap are added in registers, shifted by the
// distance of their indices: eight elements are updated, then two.
// CHECK-LABEL: llvm.func @window(
// CHECK: llvm.shufflevector {{.*}} [7, 8, 9, 10, 11, 12, 13, 14]
// CHECK: llvm.shufflevector {{.*}} [6, 7, 8, 9, 10, 11, 12, 13]
// CHECK: llvm.load {{.*}} -> vector<8xf32>
// CHECK: llvm.store {{.*}} : vector<8xf32>
// CHECK: llvm.intr.masked.load
// CHECK: llvm.intr.masked.store
func.func @window(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>,
                  %n: si32) attributes {warp.kernel} {
  %i = warp.tid : si32
  %one = warp.constant 1 : si32
  %two = warp.constant 2 : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %i1 = warp.add(%i, %one) : (si32, si32) -> si32
  %i2 = warp.add(%i, %two) : (si32, si32) -> si32
  %a = warp.mod(%i, %n) : (si32, si32) -> si32
  %b = warp.mod(%i1, %n) : (si32, si32) -> si32
  %c = warp.mod(%i2, %n) : (si32, si32) -> si32
  warp.accumulate %v, %y[%a] : f32, !warp.array<1 x f32>, si32
  warp.accumulate %v, %y[%b] : f32, !warp.array<1 x f32>, si32
  warp.accumulate %v, %y[%c] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// A load of the array between updates sees those before it.
// CHECK-LABEL: llvm.func @between(
// CHECK-NOT: llvm.shufflevector {{.*}} [7, 8, 9, 10, 11, 12, 13, 14]
func.func @between(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>,
                   %n: si32) attributes {warp.kernel} {
  %i = warp.tid : si32
  %one = warp.constant 1 : si32
  %two = warp.constant 2 : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %i1 = warp.add(%i, %one) : (si32, si32) -> si32
  %i2 = warp.add(%i, %two) : (si32, si32) -> si32
  %a = warp.mod(%i, %n) : (si32, si32) -> si32
  %b = warp.mod(%i1, %n) : (si32, si32) -> si32
  %c = warp.mod(%i2, %n) : (si32, si32) -> si32
  warp.accumulate %v, %y[%a] : f32, !warp.array<1 x f32>, si32
  warp.accumulate %v, %y[%b] : f32, !warp.array<1 x f32>, si32
  %w = warp.load %y[%i] : !warp.array<1 x f32>, si32 -> f32
  warp.accumulate %w, %y[%c] : f32, !warp.array<1 x f32>, si32
  return
}

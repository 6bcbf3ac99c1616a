// RUN: warp-opt %s --warp-pipeline="to-llvm target=sm_90,packed=31" \
// RUN:   | FileCheck %s
// RUN: warp-opt %s --warp-pipeline="to-llvm target=sm_89,packed=31" \
// RUN:   | FileCheck %s --check-prefix=OLD --implicit-check-not=inline_asm

// Elements of packed arrays of pairs begin at addresses where two floats are
// added at once, and so do those of their gradients.
// CHECK-LABEL: llvm.func @packed(
// CHECK-SAME: nvvm.kernel
// CHECK-COUNT-3: llvm.inline_asm has_side_effects "red.global.add.v2.f32
// CHECK-NOT: atomicrmw
// OLD-LABEL: llvm.func @packed(
// OLD-SAME: nvvm.kernel
// OLD-COUNT-6: llvm.atomicrmw fadd
func.func @packed(%to: !warp.array<1 x si32>, %v: !warp.vec<2 x f32>,
                  %sum: !warp.array<1 x !warp.vec<2 x f32>>,
                  %w: !warp.vec<4 x f32>,
                  %other: !warp.array<1 x !warp.vec<4 x f32>>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %j = warp.load %to[%i] : !warp.array<1 x si32>, si32 -> si32
  %a = warp.atomic add %v, %sum[%j]
    : !warp.vec<2 x f32>, !warp.array<1 x !warp.vec<2 x f32>>, si32
    -> !warp.vec<2 x f32>
  %grad = warp.grad %other
    : !warp.array<1 x !warp.vec<4 x f32>> -> !warp.array<1 x !warp.vec<4 x f32>>
  %b = warp.atomic add %w, %grad[%j]
    : !warp.vec<4 x f32>, !warp.array<1 x !warp.vec<4 x f32>>, si32
    -> !warp.vec<4 x f32>
  return
}

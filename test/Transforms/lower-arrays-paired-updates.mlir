// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm target=sm_90" \
// RUN:   | FileCheck %s
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm target=sm_89" \
// RUN:   | FileCheck %s --check-prefix=OLD --implicit-check-not=inline_asm
// RUN: warp-opt %s --split-input-file \
// RUN:     --warp-pipeline="to-llvm target=sm_90 debug" \
// RUN:   | FileCheck %s --check-prefix=OLD --implicit-check-not=inline_asm

// Two floats are added at once, from an address on that is a multiple of eight;
// the one left over is the last of an element that begins there, else the
// first.
// CHECK-LABEL: llvm.func @vector(
// CHECK-SAME: nvvm.kernel
// CHECK: %[[MINUS:.*]] = llvm.fneg
// CHECK: %[[ADDRESS:.*]] = llvm.ptrtoint %[[POINTER:.*]] : !llvm.ptr<1> to i64
// CHECK: %[[SHIFT:.*]] = llvm.and %[[ADDRESS]]
// CHECK: %[[ODD:.*]] = llvm.icmp "ne" %[[SHIFT]]
// CHECK: llvm.select %[[ODD]]
// CHECK: %[[SINGLE:.*]] = llvm.select %[[ODD]]
// CHECK: llvm.atomicrmw fadd %{{.*}}, %[[SINGLE]] syncscope("device") monotonic
// CHECK: llvm.getelementptr %[[POINTER]][%[[SHIFT]]]
// CHECK: %[[FIRST:.*]] = llvm.select %[[ODD]]
// CHECK: %[[SECOND:.*]] = llvm.select %[[ODD]]
// CHECK: llvm.inline_asm has_side_effects "red.global.add.v2.f32
// CHECK-SAME: "l,f,f,~{memory}" %{{.*}}, %[[FIRST]], %[[SECOND]]
// CHECK-NOT: atomicrmw
// OLD-LABEL: llvm.func @vector(
// OLD-SAME: nvvm.kernel
// OLD-COUNT-3: llvm.atomicrmw fadd
func.func @vector(%to: !warp.array<1 x si32>, %v: !warp.vec<3 x f32>,
                  %sum: !warp.array<1 x !warp.vec<3 x f32>>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %j = warp.load %to[%i] : !warp.array<1 x si32>, si32 -> si32
  %old = warp.atomic sub %v, %sum[%j]
    : !warp.vec<3 x f32>, !warp.array<1 x !warp.vec<3 x f32>>, si32
    -> !warp.vec<3 x f32>
  return
}

// -----

// Where the old value is used, each component has an update of its own; so do
// pairs, which might all begin between two multiples, and doubles.
// CHECK-LABEL: llvm.func @others(
// CHECK-SAME: nvvm.kernel
// CHECK-COUNT-8: llvm.atomicrmw fadd
// CHECK-NOT: inline_asm
// OLD-LABEL: llvm.func @others(
// OLD-SAME: nvvm.kernel
func.func @others(%to: !warp.array<1 x si32>, %v: !warp.vec<3 x f32>,
                  %sum: !warp.array<1 x !warp.vec<3 x f32>>,
                  %w: !warp.vec<2 x f32>,
                  %pairs: !warp.array<1 x !warp.vec<2 x f32>>,
                  %u: !warp.vec<3 x f64>,
                  %doubles: !warp.array<1 x !warp.vec<3 x f64>>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %j = warp.load %to[%i] : !warp.array<1 x si32>, si32 -> si32
  %a = warp.atomic add %v, %sum[%j]
    : !warp.vec<3 x f32>, !warp.array<1 x !warp.vec<3 x f32>>, si32
    -> !warp.vec<3 x f32>
  warp.store %a, %sum[%i]
    : !warp.vec<3 x f32>, !warp.array<1 x !warp.vec<3 x f32>>, si32
  %b = warp.atomic add %w, %pairs[%j]
    : !warp.vec<2 x f32>, !warp.array<1 x !warp.vec<2 x f32>>, si32
    -> !warp.vec<2 x f32>
  %c = warp.atomic add %u, %doubles[%j]
    : !warp.vec<3 x f64>, !warp.array<1 x !warp.vec<3 x f64>>, si32
    -> !warp.vec<3 x f64>
  return
}

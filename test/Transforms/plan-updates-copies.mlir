// RUN: warp-opt %s --split-input-file --warp-pipeline="to-launch disjoint" | FileCheck %s
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-launch" | FileCheck %s --check-prefix=OVERLAP
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-launch disjoint debug" | FileCheck %s --check-prefix=OVERLAP
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-launch disjoint deterministic" | FileCheck %s --check-prefix=OVERLAP
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-launch disjoint threads=1" | FileCheck %s --check-prefix=OVERLAP

// OVERLAP-NOT: copied =

// Sixteen workers do without atomic instructions if each has an array of its
// own: that of three floats an element, described at byte 80.
// CHECK-LABEL: func.func @forces
// CHECK-SAME: copied = <arrays = [#warp.copied_array<descriptor = 80, element_size = 12, numbers = 3>]{{.*}}exclusive = true
func.func @forces(%at: !warp.array<1 x si32>,
                  %f: !warp.array<1 x !warp.vec<3 x f32>>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %j = warp.load %at[%i] : !warp.array<1 x si32>, si32 -> si32
  %one = warp.constant 1.0 : f32
  %two = warp.constant 2.0 : f32
  %v = warp.construct(%one, %two, %one) : (f32, f32, f32) -> !warp.vec<3 x f32>
  %0 = warp.atomic add %v, %f[%j]
    : !warp.vec<3 x f32>, !warp.array<1 x !warp.vec<3 x f32>>, si32
      -> !warp.vec<3 x f32>
  %1 = warp.atomic sub %v, %f[%i]
    : !warp.vec<3 x f32>, !warp.array<1 x !warp.vec<3 x f32>>, si32
      -> !warp.vec<3 x f32>
  return
}

// -----

// An array that is loaded, too, would show what is missing in it.
// CHECK-LABEL: func.func @loaded
// CHECK-NOT: copied =
// CHECK: return
func.func @loaded(%at: !warp.array<1 x si32>, %x: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %j = warp.load %at[%i] : !warp.array<1 x si32>, si32 -> si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %0 = warp.atomic add %v, %x[%j] : f32, !warp.array<1 x f32>, si32 -> f32
  return
}

// -----

// Copies keep minima, too: of signed numbers as kind 1.
// CHECK-LABEL: func.func @minimum
// CHECK-SAME: #warp.copied_array<descriptor = 80, element_size = 4, floating = false>, #warp.copied_array<descriptor = 136, element_size = 4, floating = false, kind = 1>
func.func @minimum(%at: !warp.array<1 x si32>, %x: !warp.array<1 x si32>,
                   %y: !warp.array<1 x si32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %j = warp.load %at[%i] : !warp.array<1 x si32>, si32 -> si32
  %0 = warp.atomic add %i, %x[%j]
    : si32, !warp.array<1 x si32>, si32 -> si32
  %1 = warp.atomic min %i, %y[%j]
    : si32, !warp.array<1 x si32>, si32 -> si32
  return
}

// -----

// An element that is added to and whose minimum is taken has one value at a
// time; all updates of the code lose their atomic instructions, so the other sum
// keeps its own.
// CHECK-LABEL: func.func @both
// CHECK-NOT: copied =
// CHECK: return
func.func @both(%at: !warp.array<1 x si32>, %x: !warp.array<1 x si32>,
                %y: !warp.array<1 x si32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %j = warp.load %at[%i] : !warp.array<1 x si32>, si32 -> si32
  %0 = warp.atomic add %i, %x[%j]
    : si32, !warp.array<1 x si32>, si32 -> si32
  %1 = warp.atomic min %i, %x[%j]
    : si32, !warp.array<1 x si32>, si32 -> si32
  %2 = warp.atomic add %i, %y[%j]
    : si32, !warp.array<1 x si32>, si32 -> si32
  return
}

// -----

// Nor is there a copy for an old value that somebody uses.
// CHECK-LABEL: func.func @fetched
// CHECK-NOT: copied =
// CHECK: return
func.func @fetched(%at: !warp.array<1 x si32>, %x: !warp.array<1 x si32>,
                   %y: !warp.array<1 x si32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %j = warp.load %at[%i] : !warp.array<1 x si32>, si32 -> si32
  %0 = warp.atomic add %i, %x[%j]
    : si32, !warp.array<1 x si32>, si32 -> si32
  warp.store %0, %y[%i] : si32, !warp.array<1 x si32>, si32
  return
}

// -----

// Copies take numbers of one kind: 64-bit integers, described at byte 80, and
// the floats of the other array, at byte 136.
// CHECK-LABEL: func.func @kinds
// CHECK-SAME: copied = <arrays = [#warp.copied_array<descriptor = 80, element_size = 8, width = 64, floating = false>, #warp.copied_array<descriptor = 136, element_size = 8, width = 64>]
func.func @kinds(%at: !warp.array<1 x si32>, %x: !warp.array<1 x si64>,
                 %y: !warp.array<1 x f64>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %j = warp.load %at[%i] : !warp.array<1 x si32>, si32 -> si32
  %one = warp.constant 1 : si64
  %half = warp.constant 0.5 : f64
  %0 = warp.atomic add %one, %x[%j]
    : si64, !warp.array<1 x si64>, si32 -> si64
  %1 = warp.atomic add %half, %y[%j]
    : f64, !warp.array<1 x f64>, si32 -> f64
  return
}

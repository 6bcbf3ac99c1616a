// RUN: warp-opt %s --split-input-file --warp-pipeline="to-thread deterministic" --warp-form-launch --warp-plan-updates | FileCheck %s
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-thread" --warp-form-launch --warp-plan-updates | FileCheck %s --check-prefix=NONE
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-thread deterministic ordered" --warp-form-launch --warp-plan-updates | FileCheck %s --check-prefix=NONE

// NONE-NOT: sum =

// An array that is only added to has exact sums; the others are listed after
// it. Their descriptors follow the arguments.
// CHECK-LABEL: func.func @scatter
// CHECK-SAME: sums = [#warp.summed_array<width = 32, descriptor = 136, element_size = 4>, #warp.summed_array<descriptor = 24, element_size = 4>, #warp.summed_array<descriptor = 80, element_size = 4>]
// CHECK: warp.atomic_components add{{.*}}{warp.update = #warp.update<sum = 192>}
// CHECK: warp.atomic_components sub{{.*}}{warp.update = #warp.update<sum = 192>}
func.func @scatter(%x: !warp.array<1 x f32>, %to: !warp.array<1 x si32>,
                   %sum: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %j = warp.load %to[%i] : !warp.array<1 x si32>, si32 -> si32
  %a = warp.atomic add %v, %sum[%j]
    : f32, !warp.array<1 x f32>, si32 -> f32
  %b = warp.atomic sub %v, %sum[%i]
    : f32, !warp.array<1 x f32>, si32 -> f32
  return
}

// -----

// All components of an element, by a view, and gradients.
// CHECK-LABEL: func.func @views
// CHECK-SAME: sums = [#warp.summed_array<width = 64, descriptor = 24, element_size = 24>, #warp.summed_array<width = 32, descriptor = 80, gradient = true, element_size = 4, stride_scale = 2>]
// CHECK: warp.atomic_components add{{.*}}{warp.update = #warp.update<sum = 136>}
// CHECK: warp.atomic_components add{{.*}}{warp.update = #warp.update<sum = 168>}
func.func @views(%sum: !warp.array<2 x !warp.vec<3 x f64>>,
                 %h: !warp.array<1 x f16>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %row = warp.view %sum[%i] : !warp.array<2 x !warp.vec<3 x f64>>, si32
    -> !warp.array<1 x !warp.vec<3 x f64>>
  %one = warp.constant 1.0 : f64
  %v = warp.construct(%one, %one, %one) : (f64, f64, f64) -> !warp.vec<3 x f64>
  %a = warp.atomic add %v, %row[%i]
    : !warp.vec<3 x f64>, !warp.array<1 x !warp.vec<3 x f64>>, si32
    -> !warp.vec<3 x f64>
  %g = warp.grad %h : !warp.array<1 x f16> -> !warp.array<1 x f32>
  %w = warp.constant 1.0 : f32
  %b = warp.atomic add %w, %g[%i]
    : f32, !warp.array<1 x f32>, si32 -> f32
  return
}

// -----

// A value that the launch reads, or an update returns, has to be there at once;
// a sum of 16-bit floats would be rounded twice.
// CHECK-LABEL: func.func @in_order
// CHECK-NOT: sum =
func.func @in_order(%read: !warp.array<1 x f32>, %old: !warp.array<1 x f32>,
                    %h: !warp.array<1 x f16>, %least: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %one = warp.constant 1.0 : f32
  %v = warp.load %read[%i] : !warp.array<1 x f32>, si32 -> f32
  %a = warp.atomic add %v, %read[%i] : f32, !warp.array<1 x f32>, si32 -> f32
  %b = warp.atomic add %v, %old[%i] : f32, !warp.array<1 x f32>, si32 -> f32
  %c = warp.atomic min %b, %least[%i] : f32, !warp.array<1 x f32>, si32 -> f32
  %half = warp.constant 1.0 : f16
  %d = warp.atomic add %half, %h[%i] : f16, !warp.array<1 x f16>, si32 -> f16
  return
}

// RUN: warp-opt %s | warp-opt | FileCheck %s

!v3 = !warp.vec<3 x f32>
!m23 = !warp.mat<2x3 x f32>

// CHECK-LABEL: func.func @constants
func.func @constants() -> (i1, si8, ui64, f16, bf16, f32, f64) {
  // CHECK: warp.constant true
  %0 = warp.constant true
  // CHECK: warp.constant -128 : si8
  %1 = warp.constant -128 : si8
  // CHECK: warp.constant 18446744073709551615 : ui64
  %2 = warp.constant 18446744073709551615 : ui64
  // CHECK: warp.constant 1.500000e+00 : f16
  %3 = warp.constant 1.5 : f16
  // CHECK: warp.constant 0x7FC0 : bf16
  %4 = warp.constant 0x7FC0 : bf16
  // CHECK: warp.constant 0xFF800000 : f32
  %5 = warp.constant 0xFF800000 : f32
  // CHECK: warp.constant 1.000000e-01 : f64
  %6 = warp.constant 0.1 : f64
  return %0, %1, %2, %3, %4, %5, %6 : i1, si8, ui64, f16, bf16, f32, f64
}

// Scalars and composites convert; loop counters enter and leave.
// CHECK-LABEL: func.func @casts
func.func @casts(%i: si32, %v: !v3, %n: index) -> (f32, i1, !warp.vec<3 x si64>, si32, index, f32) {
  // CHECK: warp.cast %{{.*}} : si32 to f32
  %0 = warp.cast %i : si32 to f32
  // CHECK: warp.cast %{{.*}} : si32 to i1
  %1 = warp.cast %i : si32 to i1
  // CHECK: warp.cast %{{.*}} : !warp.vec<3 x f32> to !warp.vec<3 x si64>
  %2 = warp.cast %v : !v3 to !warp.vec<3 x si64>
  // CHECK: warp.cast %{{.*}} : index to si32
  %3 = warp.cast %n : index to si32
  // CHECK: warp.cast %{{.*}} : si32 to index
  %4 = warp.cast %i : si32 to index
  // CHECK: warp.bitcast %{{.*}} : si32 to f32
  %5 = warp.bitcast %i : si32 to f32
  return %0, %1, %2, %3, %4, %5 : f32, i1, !warp.vec<3 x si64>, si32, index, f32
}

// Components, a smaller composite and a rest, one for all, or none.
// CHECK-LABEL: func.func @construct
func.func @construct(%x: f32, %v: !v3, %q: !warp.quat<f32>) -> (!v3, !warp.vec<4 x f32>, !m23, !m23, !m23, !warp.transform<f32>) {
  // CHECK: warp.construct(%{{.*}}, %{{.*}}, %{{.*}}) : (f32, f32, f32) -> !warp.vec<3 x f32>
  %0 = warp.construct(%x, %x, %x) : (f32, f32, f32) -> !v3
  // CHECK: warp.construct(%{{.*}}, %{{.*}}) : (!warp.vec<3 x f32>, f32) -> !warp.vec<4 x f32>
  %1 = warp.construct(%v, %x) : (!v3, f32) -> !warp.vec<4 x f32>
  // CHECK: warp.construct(%{{.*}}, %{{.*}}) : (!warp.vec<3 x f32>, !warp.vec<3 x f32>) -> !warp.mat<2x3 x f32>
  %2 = warp.construct(%v, %v) : (!v3, !v3) -> !m23
  // CHECK: warp.construct(%{{.*}}) : (f32) -> !warp.mat<2x3 x f32>
  %3 = warp.construct(%x) : (f32) -> !m23
  // CHECK: warp.construct() : () -> !warp.mat<2x3 x f32>
  %4 = warp.construct() : () -> !m23
  // CHECK: warp.construct(%{{.*}}, %{{.*}}) : (!warp.vec<3 x f32>, !warp.quat<f32>) -> !warp.transform<f32>
  %5 = warp.construct(%v, %q) : (!v3, !warp.quat<f32>) -> !warp.transform<f32>
  return %0, %1, %2, %3, %4, %5 : !v3, !warp.vec<4 x f32>, !m23, !m23, !m23, !warp.transform<f32>
}

// CHECK-LABEL: func.func @access
func.func @access(%v: !v3, %m: !m23, %x: f32, %i: si32, %j: ui8) -> (f32, f32, !v3, !v3, !m23, !m23) {
  // CHECK: warp.extract %{{.*}}[%{{.*}}] : !warp.vec<3 x f32>, si32 -> f32
  %0 = warp.extract %v[%i] : !v3, si32 -> f32
  // CHECK: warp.extract %{{.*}}[%{{.*}}, %{{.*}}] : !warp.mat<2x3 x f32>, si32, ui8 -> f32
  %1 = warp.extract %m[%i, %j] : !m23, si32, ui8 -> f32
  // CHECK: warp.extract %{{.*}}[%{{.*}}] : !warp.mat<2x3 x f32>, si32 -> !warp.vec<3 x f32>
  %2 = warp.extract %m[%i] : !m23, si32 -> !v3
  // CHECK: warp.insert %{{.*}}, %{{.*}}[%{{.*}}] : f32, !warp.vec<3 x f32>, si32
  %3 = warp.insert %x, %v[%i] : f32, !v3, si32
  // CHECK: warp.insert %{{.*}}, %{{.*}}[%{{.*}}, %{{.*}}] : f32, !warp.mat<2x3 x f32>, si32, si32
  %4 = warp.insert %x, %m[%i, %i] : f32, !m23, si32, si32
  // CHECK: warp.insert %{{.*}}, %{{.*}}[%{{.*}}] : !warp.vec<3 x f32>, !warp.mat<2x3 x f32>, si32
  %5 = warp.insert %v, %m[%i] : !v3, !m23, si32
  return %0, %1, %2, %3, %4, %5 : f32, f32, !v3, !v3, !m23, !m23
}

!s = !warp.struct<"S", {x: f32, data: !warp.array<1 x f32>, "two words": i1}>

// CHECK-LABEL: func.func @structs
func.func @structs(%x: f32, %a: !warp.array<1 x f32>, %b: i1) -> (f32, !s, i1) {
  // CHECK: warp.struct_create(%{{.*}}, %{{.*}}, %{{.*}}) : (f32, !warp.array<1 x f32>, i1) -> !S
  %0 = warp.struct_create(%x, %a, %b) : (f32, !warp.array<1 x f32>, i1) -> !s
  // CHECK: warp.struct_get %{{.*}}["x"] : !S -> f32
  %1 = warp.struct_get %0["x"] : !s -> f32
  // CHECK: warp.struct_set %{{.*}}, %{{.*}}["data"] : !warp.array<1 x f32>, !S
  %2 = warp.struct_set %a, %0["data"] : !warp.array<1 x f32>, !s
  // CHECK: warp.struct_get %{{.*}}["two words"]
  %3 = warp.struct_get %2["two words"] : !s -> i1
  return %1, %2, %3 : f32, !s, i1
}

// RUN: warp-opt %s | warp-opt | FileCheck %s

!v3 = !warp.vec<3 x f32>
!a1 = !warp.array<1 x !v3>
!a3 = !warp.array<3 x f32>
!s = !warp.struct<"S", {x: !v3, n: ui32}>

// CHECK-LABEL: func.func @accesses
func.func @accesses(%a: !a1, %b: !a3, %i: si32, %j: ui64, %x: f32) -> !v3 {
  // CHECK: warp.load %{{.*}}[%{{.*}}] : !warp.array<1 x !warp.vec<3 x f32>>, si32 -> !warp.vec<3 x f32>
  %0 = warp.load %a[%i] : !a1, si32 -> !v3
  // CHECK: warp.load %{{.*}}[%{{.*}}, %{{.*}}, %{{.*}}] : !warp.array<3 x f32>, si32, ui64, si32 -> f32
  %1 = warp.load %b[%i, %j, %i] : !a3, si32, ui64, si32 -> f32
  // CHECK: warp.store %{{.*}}, %{{.*}}[%{{.*}}] : !warp.vec<3 x f32>, !warp.array<1 x !warp.vec<3 x f32>>, si32
  warp.store %0, %a[%i] : !v3, !a1, si32
  // CHECK: warp.store %{{.*}}, %{{.*}}[%{{.*}}, %{{.*}}, %{{.*}}] : f32, !warp.array<3 x f32>, si32, si32, ui64
  warp.store %x, %b[%i, %i, %j] : f32, !a3, si32, si32, ui64
  return %0 : !v3
}

// Every kind of atomic is printed by its name.
// CHECK-LABEL: func.func @atomics
func.func @atomics(%a: !warp.array<1 x ui32>, %v: !a1, %i: si32, %n: ui32, %x: !v3) {
  // CHECK: warp.atomic add %{{.*}}, %{{.*}}[%{{.*}}] : !warp.vec<3 x f32>, !warp.array<1 x !warp.vec<3 x f32>>, si32 -> !warp.vec<3 x f32>
  %0 = warp.atomic add %x, %v[%i] : !v3, !a1, si32 -> !v3
  // CHECK: warp.atomic sub
  %1 = warp.atomic sub %n, %a[%i] : ui32, !warp.array<1 x ui32>, si32 -> ui32
  // CHECK: warp.atomic min
  %2 = warp.atomic min %n, %a[%i] : ui32, !warp.array<1 x ui32>, si32 -> ui32
  // CHECK: warp.atomic max
  %3 = warp.atomic max %n, %a[%i] : ui32, !warp.array<1 x ui32>, si32 -> ui32
  // CHECK: warp.atomic and
  %4 = warp.atomic and %n, %a[%i] : ui32, !warp.array<1 x ui32>, si32 -> ui32
  // CHECK: warp.atomic or
  %5 = warp.atomic or %n, %a[%i] : ui32, !warp.array<1 x ui32>, si32 -> ui32
  // CHECK: warp.atomic xor
  %6 = warp.atomic xor %n, %a[%i] : ui32, !warp.array<1 x ui32>, si32 -> ui32
  // CHECK: warp.atomic exch
  %7 = warp.atomic exch %n, %a[%i] : ui32, !warp.array<1 x ui32>, si32 -> ui32
  // CHECK: warp.atomic_cas %{{.*}}, %{{.*}}, %{{.*}}[%{{.*}}] : ui32, ui32, !warp.array<1 x ui32>, si32 -> ui32
  %8 = warp.atomic_cas %n, %n, %a[%i] : ui32, ui32, !warp.array<1 x ui32>, si32 -> ui32
  return
}

// CHECK-LABEL: func.func @views
func.func @views(%a: !a3, %v: !a1, %s: !warp.array<2 x !s>, %i: si32) -> si32 {
  // CHECK: warp.view %{{.*}}[%{{.*}}, %{{.*}}] : !warp.array<3 x f32>, si32, si32 -> !warp.array<1 x f32>
  %0 = warp.view %a[%i, %i] : !a3, si32, si32 -> !warp.array<1 x f32>
  // CHECK: warp.slice %{{.*}}[%{{.*}} : %{{.*}} : %{{.*}}] dim 2 : !warp.array<3 x f32>, si32, si32, si32
  %1 = warp.slice %a[%i : %i : %i] dim 2 : !a3, si32, si32, si32
  // CHECK: warp.component_view %{{.*}}[%{{.*}}] : !warp.array<1 x !warp.vec<3 x f32>>, si32 -> !warp.array<1 x f32>
  %2 = warp.component_view %v[%i] : !a1, si32 -> !warp.array<1 x f32>
  // CHECK: warp.component_view %{{.*}}[] field "x" : !warp.array<2 x !S> -> !warp.array<2 x !warp.vec<3 x f32>>
  %3 = warp.component_view %s[] field "x" : !warp.array<2 x !s> -> !warp.array<2 x !v3>
  // CHECK: warp.dim %{{.*}}, 1 : !warp.array<3 x f32> -> si32
  %4 = warp.dim %a, 1 : !a3 -> si32
  return %4 : si32
}

// CHECK-LABEL: func.func @threads
func.func @threads(%x: f32, %c: i1) attributes {warp.kernel} {
  // CHECK: warp.tid : si32
  %i = warp.tid : si32
  // CHECK: warp.tid : si32, si32, si32, si32
  %0:4 = warp.tid : si32, si32, si32, si32
  // CHECK: warp.printf "%d %% %f\0A"(%{{.*}}, %{{.*}}) : si32, f32
  warp.printf "%d %% %f\0A"(%i, %x) : si32, f32
  // CHECK: warp.printf "plain"()
  warp.printf "plain"()
  // CHECK: warp.assert %{{.*}}, "message"
  warp.assert %c, "message"
  return
}

// CHECK-LABEL: func.func @addresses
func.func @addresses(%a: !a3, %p: ui64, %n: si32) -> !warp.array<2 x f32> {
  // CHECK: warp.pointer %{{.*}} : !warp.array<3 x f32> -> ui64
  %0 = warp.pointer %a : !a3 -> ui64
  // CHECK: warp.stride %{{.*}}, 2 : !warp.array<3 x f32> -> si32
  %1 = warp.stride %a, 2 : !a3 -> si32
  // CHECK: warp.array_at %{{.*}}[%{{.*}}] : ui64, si32 -> !warp.array<1 x f32>
  %2 = warp.array_at %p[%n] : ui64, si32 -> !warp.array<1 x f32>
  // CHECK: warp.array_at %{{.*}}[%{{.*}}] grad(%{{.*}} : ui64) : ui64, si32 -> !warp.array<1 x f32>
  %g = warp.array_at %p[%n] grad(%0 : ui64) : ui64, si32 -> !warp.array<1 x f32>
  // CHECK: warp.index_dim %{{.*}}[%{{.*}}] dim 1 : !warp.array<3 x f32>, si32 -> !warp.array<2 x f32>
  %3 = warp.index_dim %a[%n] dim 1 : !a3, si32 -> !warp.array<2 x f32>
  return %3 : !warp.array<2 x f32>
}

// Thread IR: one operation for all components of an element.
// CHECK-LABEL: func.func @thread_ir
func.func @thread_ir(%a: !a1, %s: !warp.array<2 x !s>, %i: i32, %j: i64, %x: f32) {
  // CHECK: warp.load_components %{{.*}}[%{{.*}}] : !warp.array<1 x !warp.vec<3 x f32>>, i32 -> f32, f32, f32
  %0:3 = warp.load_components %a[%i] : !a1, i32 -> f32, f32, f32
  // CHECK: warp.load_components %{{.*}}[%{{.*}}, %{{.*}}] : !warp.array<2 x !S>, i32, i64 -> f32, f32, f32, i32
  %1:4 = warp.load_components %s[%i, %j] : !warp.array<2 x !s>, i32, i64 -> f32, f32, f32, i32
  // CHECK: warp.store_components(%{{.*}}, %{{.*}}, %{{.*}}), %{{.*}}[%{{.*}}] : (f32, f32, f32), !warp.array<1 x !warp.vec<3 x f32>>, i32
  warp.store_components (%0#0, %0#1, %x), %a[%i] : (f32, f32, f32), !a1, i32
  // CHECK: warp.atomic_components max(%{{.*}}, %{{.*}}, %{{.*}}), %{{.*}}[%{{.*}}] : (f32, f32, f32), !warp.array<1 x !warp.vec<3 x f32>>, i32 -> f32, f32, f32
  %2:3 = warp.atomic_components max(%x, %x, %x), %a[%i] : (f32, f32, f32), !a1, i32 -> f32, f32, f32
  // CHECK: warp.address %{{.*}}[%{{.*}}] : !warp.array<1 x !warp.vec<3 x f32>>, i32
  %3 = warp.address %a[%i] : !a1, i32
  return
}

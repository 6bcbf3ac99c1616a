// RUN: warp-opt %s --split-input-file --warp-specialize | FileCheck %s

#debug = #warp.variant<target = <name = "cpu", bits = 256>, debug = true>

// Run-time indices of components are checked where they are used; constants
// have been.
// CHECK-LABEL: func.func @values
// CHECK: warp.check_index[%[[I:.*]]] of [3], "a vector" : si32
// CHECK-NEXT: warp.extract %{{.*}}[%[[I]]]
// CHECK-NEXT: warp.check_index[%[[I]], %[[C:.*]]] of [2, 4], "a matrix" : si32, si32
// CHECK-NEXT: warp.insert
// CHECK-NEXT: warp.check_index[%[[I]]] of [4], "a quaternion"
// CHECK-NEXT: warp.component_view
// CHECK-NEXT: warp.check_index[%[[I]]] of [5], "an array of the thread"
// CHECK-NEXT: warp.position
// CHECK-NOT: warp.check_index
// CHECK: return
func.func @values(%v: !warp.vec<3 x f32>, %m: !warp.mat<2x4 x f32>, %i: si32,
                  %a: !warp.array<1 x !warp.quat<f32>>, %o: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #debug} {
  %c = warp.constant 1 : si32
  %x = warp.extract %v[%i] : !warp.vec<3 x f32>, si32 -> f32
  %n = warp.insert %x, %m[%i, %c] : f32, !warp.mat<2x4 x f32>, si32, si32
  %b = warp.component_view %a[%i] : !warp.array<1 x !warp.quat<f32>>, si32
    -> !warp.array<1 x f32>
  %p = warp.position %i of 5 : si32 -> si32
  %y = warp.extract %n[%c, %c] : !warp.mat<2x4 x f32>, si32, si32 -> f32
  warp.store %y, %b[%p] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

#release = #warp.variant<target = <name = "cpu", bits = 256>>

// Other launches check what they must.
// CHECK-LABEL: func.func @release
// CHECK-NOT: warp.check_index
// CHECK-NOT: "checked in debug mode"
// CHECK: warp.assert %{{.*}}, "slice step is zero" always
func.func @release(%v: !warp.vec<3 x f32>, %i: si32, %p: i1, %o: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #release} {
  %x = warp.extract %v[%i] : !warp.vec<3 x f32>, si32 -> f32
  warp.assert %p, "checked in debug mode"
  warp.assert %p, "slice step is zero" always
  warp.store %x, %o[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// RUN: warp-opt %s --split-input-file --warp-differentiate-kernel=mode=winners --canonicalize --cse | FileCheck %s

// The second launch writes nothing but the tangent of the thread that finds its
// value, or NaN as its value is, and claims the element first.
// CHECK-LABEL: @largest_tangent(
// CHECK-SAME: %[[X:[^ :]*]]: !warp.array<1 x f32>, %[[Y:[^ :]*]]: !warp.array<1 x f32>,
// CHECK-SAME: %[[DX:[^ :]*]]: !warp.array<1 x f32> {{{[^}]*}}kind = tangent, leaf = 0
// CHECK-SAME: %[[DY:[^ :]*]]: !warp.array<1 x f32> {{{[^}]*}}kind = tangent, leaf = 1
// CHECK-SAME: %[[C:[^ :]*]]: !warp.array<1 x si32> {{{[^}]*}}kind = claims, leaf = 1
// CHECK: %[[V:.*]] = warp.load %[[X]]
// CHECK: %[[T:.*]] = warp.load %[[DX]]
// CHECK: %[[L:.*]] = warp.load %[[Y]]
// CHECK: %[[E:.*]] = warp.eq(%[[L]], %[[V]])
// CHECK: %[[VN:.*]] = warp.isnan(%[[V]])
// CHECK: %[[LN:.*]] = warp.isnan(%[[L]])
// CHECK: %[[W:.*]] = warp.where(%[[VN]], %[[LN]], %[[E]])
// CHECK: scf.if %[[W]] {
// CHECK: %[[B:.*]] = warp.atomic exch %{{.*}}, %[[C]]
// CHECK: %[[F:.*]] = warp.eq(%[[B]],
// CHECK: scf.if %[[F]] {
// CHECK: warp.store %[[T]], %[[DY]]
// CHECK-NOT: warp.atomic
// CHECK-NOT: warp.store
func.func @largest(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %zero = warp.constant 0 : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %o = warp.atomic max %v, %y[%zero] : f32, !warp.array<1 x f32>, si32 -> f32
  return
}

// -----

// Components have a winner each.
// CHECK-LABEL: @corner_tangent(
// CHECK-SAME: !warp.array<1 x !warp.vec<2 x si32>> {{{[^}]*}}kind = claims, leaf = 1
// CHECK-COUNT-2: warp.atomic exch
// CHECK-NOT: warp.atomic
func.func @corner(%x: !warp.array<1 x !warp.vec<2 x f32>>,
                  %y: !warp.array<1 x !warp.vec<2 x f32>>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %zero = warp.constant 0 : si32
  %v = warp.load %x[%i] : !warp.array<1 x !warp.vec<2 x f32>>, si32
      -> !warp.vec<2 x f32>
  %o = warp.atomic min %v, %y[%zero] : !warp.vec<2 x f32>,
      !warp.array<1 x !warp.vec<2 x f32>>, si32 -> !warp.vec<2 x f32>
  return
}

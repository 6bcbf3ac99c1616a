// RUN: warp-opt %s --split-input-file --warp-differentiate-kernel="mode=forward width=2" --canonicalize --cse | FileCheck %s

// Each direction has a twin; what is known of values is computed once.
// CHECK-LABEL: @twice_tangent(
// CHECK-SAME: %[[X:.*]]: !warp.array<1 x f32>, %[[Y:.*]]: !warp.array<1 x f32>,
// CHECK-SAME: %[[A:[^ ]*]]: !warp.array<1 x f32> {warp.hidden = #warp.hidden<kind = tangent, leaf = 0>
// CHECK-SAME: %[[B:[^ ]*]]: !warp.array<1 x f32> {warp.hidden = #warp.hidden<kind = tangent, leaf = 0, direction = 1>
// CHECK-SAME: leaf = 1
// CHECK-SAME: leaf = 1
// CHECK: %[[V:.*]] = warp.load %[[X]]
// CHECK-DAG: %[[DA:.*]] = warp.load %[[A]]
// CHECK-DAG: %[[DB:.*]] = warp.load %[[B]]
// CHECK: %[[C:.*]] = warp.cos(%[[V]])
// CHECK-NOT: warp.cos
// CHECK-DAG: warp.mul(%[[DA]], %[[C]])
// CHECK-DAG: warp.mul(%[[DB]], %[[C]])
func.func @twice(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %s = warp.sin(%v) : (f32) -> f32
  warp.store %s, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// A loop carries the tangents of all directions after its values.
// CHECK-LABEL: @loop_tangent(
// CHECK: scf.for {{.*}} iter_args(%{{.*}} = %{{.*}}, %[[A:.*]] = %{{.*}}, %[[B:.*]] = %{{.*}}) -> (f32, f32, f32)
// CHECK-DAG: warp.mul(%[[A]], %{{.*}})
// CHECK-DAG: warp.mul(%[[B]], %{{.*}})
func.func @loop(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %begin = arith.constant 0 : index
  %step = arith.constant 1 : index
  %end = arith.constant 8 : index
  %one = warp.constant 1.0 : f32
  %i = warp.tid : si32
  %p = scf.for %k = %begin to %end step %step iter_args(%p = %one) -> (f32) {
    %j = warp.cast %k : index to si32
    %v = warp.load %x[%j] : !warp.array<1 x f32>, si32 -> f32
    %q = warp.mul(%p, %v) : (f32, f32) -> f32
    scf.yield %q : f32
  }
  warp.store %p, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// RUN: warp-opt %s --split-input-file --warp-form-launch \
// RUN:     --warp-widen-threads | FileCheck %s

!Body = !warp.struct<"Body", {x: !warp.vec<3 x f32>, v: !warp.vec<3 x f32>, r: f32, m: f32}>
#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 7, non_negative = 8,
      lanes = 4>

// Fields of one element that are half of it or more are loaded with the rest.
// CHECK-LABEL: func.func @neighbours
// CHECK: %[[B:.*]]:8 = warp.load_lanes gather %arg0[
// CHECK-NOT: warp.load_lanes gather
// CHECK: arith.addf %[[B]]#4, %[[B]]#6
// CHECK: return
func.func @neighbours(%b: !warp.array<1 x !Body>, %k: !warp.array<1 x si32>,
                      %y: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %j = warp.load_components %k[%i] : !warp.array<1 x si32>, i32 -> i32
  %r = warp.component_view %b[] field "r" : !warp.array<1 x !Body> -> !warp.array<1 x f32>
  %v = warp.component_view %b[] field "v"
    : !warp.array<1 x !Body> -> !warp.array<1 x !warp.vec<3 x f32>>
  %a = warp.load_components %r[%j] : !warp.array<1 x f32>, i32 -> f32
  %v0, %v1, %v2 = warp.load_components %v[%j]
    : !warp.array<1 x !warp.vec<3 x f32>>, i32 -> f32, f32, f32
  %s = arith.addf %v1, %a : f32
  warp.store_components(%s), %y[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

!Body = !warp.struct<"Body", {x: !warp.vec<3 x f32>, v: !warp.vec<3 x f32>, r: f32, m: f32}>
#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 7, non_negative = 8,
      lanes = 4>

// Two numbers of eight are gathered; so are fields that a store stands between,
// and those of different elements.
// CHECK-LABEL: func.func @apart
// CHECK-NOT: :8 = warp.load_lanes
// CHECK: return
func.func @apart(%b: !warp.array<1 x !Body>, %k: !warp.array<1 x si32>,
                 %y: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %j = warp.load_components %k[%i] : !warp.array<1 x si32>, i32 -> i32
  %r = warp.component_view %b[] field "r" : !warp.array<1 x !Body> -> !warp.array<1 x f32>
  %m = warp.component_view %b[] field "m" : !warp.array<1 x !Body> -> !warp.array<1 x f32>
  %v = warp.component_view %b[] field "v"
    : !warp.array<1 x !Body> -> !warp.array<1 x !warp.vec<3 x f32>>
  %a = warp.load_components %r[%j] : !warp.array<1 x f32>, i32 -> f32
  %c = warp.load_components %m[%j] : !warp.array<1 x f32>, i32 -> f32
  %s = arith.addf %a, %c : f32
  warp.store_components(%s), %y[%i] : (f32), !warp.array<1 x f32>, i32
  %v0, %v1, %v2 = warp.load_components %v[%j]
    : !warp.array<1 x !warp.vec<3 x f32>>, i32 -> f32, f32, f32
  %n = warp.load_components %k[%j] : !warp.array<1 x si32>, i32 -> i32
  %e = warp.load_components %r[%n] : !warp.array<1 x f32>, i32 -> f32
  %t = arith.addf %v1, %e : f32
  warp.store_components(%t), %y[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

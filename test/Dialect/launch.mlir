// RUN: warp-opt %s --verify-roundtrip | FileCheck %s

// Operations of phase launch survive printing and parsing, with and without
// results, operands and lanes.

// CHECK-LABEL: func.func @scalar
// CHECK: warp.group
// CHECK: %[[SUM:.*]]:2 = warp.threads attributes {kinds = array<i32: 0, 3>, types = [f64, ui32]}
// CHECK: warp.yield %{{.*}}, %{{.*}} : f64, i32
// CHECK: } : f64, i32
// CHECK: warp.once
func.func @scalar(%a: f64, %x: !warp.array<1 x f64>) attributes {warp.kernel} {
  warp.group {
    %sum:2 = warp.threads attributes {
        kinds = array<i32: 0, 3>, types = [f64, ui32]} {
    ^bb0(%i: i32, %j: i32):
      warp.yield %a, %j : f64, i32
    } : f64, i32
    warp.once {
      %c0 = arith.constant 0 : i32
      %old = warp.atomic_components add(%sum#0), %x[%c0]
        : (f64), !warp.array<1 x f64>, i32 -> f64
    }
  }
  return
}

// CHECK-LABEL: func.func @lanes
// CHECK: warp.threads attributes {kinds = array<i32: 0>, lanes = 4 : i64, types = [f32]}
// CHECK: warp.lane_numbers : vector<4xi32>
// CHECK: warp.broadcast %{{.*}} : i32 -> vector<4xi32>
// CHECK: warp.any %{{.*}} : vector<4xi1>
// CHECK: warp.load_lanes gather %{{.*}}[%{{.*}}, %{{.*}}] mask %{{.*}}, (vector<4xi32>, i32), vector<4xi1> -> vector<4xf32>
// CHECK: warp.each_lane %{{.*}}(%{{.*}}) {
// CHECK: } : vector<4xi1>, vector<4xf32> -> vector<4xf32>
// CHECK: warp.each_lane %{{.*}}() {
// CHECK: } : vector<4xi1>
// CHECK: warp.store_lanes unit(%{{.*}}), %{{.*}}[%{{.*}}, %{{.*}}] mask %{{.*}}, (i32, i32), vector<4xi1>
// CHECK: warp.combine_lanes %{{.*}} {kind = 0 : i32, type = f32} : vector<4xf32> -> f32
func.func @lanes(%x: !warp.array<2 x f32>, %n: i32) attributes {warp.kernel} {
  warp.group {
    %sum = warp.threads attributes {
        kinds = array<i32: 0>, lanes = 4 : i64, types = [f32]} {
    ^bb0(%i: i32, %m: vector<4xi1>):
      %lanes = warp.lane_numbers : vector<4xi32>
      %first = warp.broadcast %i : i32 -> vector<4xi32>
      %any = warp.any %m : vector<4xi1>
      %v = warp.load_lanes gather %x[%lanes, %n] mask %m
        {nonNegative = array<i1: true, false>}
        : !warp.array<2 x f32>, (vector<4xi32>, i32), vector<4xi1>
        -> vector<4xf32>
      %w = warp.each_lane %m (%v) {
      ^bb0(%one: f32):
        warp.yield %one : f32
      } : vector<4xi1>, vector<4xf32> -> vector<4xf32>
      warp.each_lane %m () {
        warp.yield
      } : vector<4xi1>
      warp.store_lanes unit(%w), %x[%n, %i] mask %m
        {nonNegative = array<i1: true, true>}
        : (vector<4xf32>), !warp.array<2 x f32>, (i32, i32), vector<4xi1>
      %total = warp.combine_lanes %w {kind = 0 : i32, type = f32}
        : vector<4xf32> -> f32
      warp.yield %w : vector<4xf32>
    } : f32
  }
  return
}

// RUN: warp-opt %s --split-input-file --warp-form-launch \
// RUN:     --warp-widen-threads | FileCheck %s

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 1,
      lanes = 4>

// A function with a form for lanes is called once for all of them, with vectors
// of all but the operands that they share.
// CHECK-LABEL: func.func @volume
// CHECK-SAME: %[[ID:[^:]*]]: i64
// CHECK: %[[ONE:.*]] = {{.*}} dense<1> : vector<4xi32>
// CHECK-NOT: warp.each_lane
// CHECK: warp.library_call "warp_volume_index_lanes"(%[[ID]], %[[V:.*]], %[[V]], %[[ONE]]) : (i64, vector<4xi32>, vector<4xi32>, vector<4xi32>) -> vector<4xi32>
// CHECK: return
func.func @volume(%id: i64, %x: !warp.array<1 x si32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %one = arith.constant 1 : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x si32>, i32 -> i32
  %n = warp.library_call "warp_volume_index"(%id, %v, %v, %one)
      : (i64, i32, i32, i32) -> i32
  warp.store_components(%n), %x[%i] : (i32), !warp.array<1 x si32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 3,
      lanes = 4>

// Lanes that ask different volumes call one by one.
// CHECK-LABEL: func.func @volumes
// CHECK: warp.each_lane
// CHECK: warp.library_call "warp_volume_index"(
func.func @volumes(%ids: !warp.array<1 x ui64>, %x: !warp.array<1 x si32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %id = warp.load_components %ids[%i] : !warp.array<1 x ui64>, i32 -> i64
  %v = warp.load_components %x[%i] : !warp.array<1 x si32>, i32 -> i32
  %n = warp.library_call "warp_volume_index"(%id, %v, %v, %v)
      : (i64, i32, i32, i32) -> i32
  warp.store_components(%n), %x[%i] : (i32), !warp.array<1 x si32>, i32
  return
}

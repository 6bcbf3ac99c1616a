// RUN: warp-opt %s --warp-specialize="rank=1" | FileCheck %s

// Plain updates of different gradients begin with all of their loads.
// CHECK-LABEL: func.func @apart
// CHECK: warp.load
// CHECK: warp.load
// CHECK: warp.store
// CHECK: warp.store
func.func @apart(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %v: f32)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %gx = warp.grad %x : !warp.array<1 x f32> -> !warp.array<1 x f32>
  %gy = warp.grad %y : !warp.array<1 x f32> -> !warp.array<1 x f32>
  warp.accumulate %v, %gx[%i] {unique = 1 : i64} : f32, !warp.array<1 x f32>, si32
  warp.accumulate %v, %gy[%i] {unique = 1 : i64} : f32, !warp.array<1 x f32>, si32
  return
}

// Those of one gradient keep their order.
// CHECK-LABEL: func.func private @together
// CHECK: warp.load
// CHECK: warp.store
// CHECK: warp.load
// CHECK: warp.store
func.func private @together(%x: !warp.array<1 x f32>, %v: f32, %i: si32) {
  %gx = warp.grad %x : !warp.array<1 x f32> -> !warp.array<1 x f32>
  warp.accumulate %v, %gx[%i] {unique = 1 : i64} : f32, !warp.array<1 x f32>, si32
  warp.accumulate %v, %gx[%i] {unique = 1 : i64} : f32, !warp.array<1 x f32>, si32
  return
}

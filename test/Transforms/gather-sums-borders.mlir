// RUN: warp-opt %s --split-input-file --warp-gather-sums --canonicalize --cse | FileCheck %s

// Threads whose clamped index is their own plus a constant are gathered; those
// at a border add by themselves.
// CHECK-LABEL: func.func @clamped_sums
// CHECK-SAME: warp.halo = array<i64: 1>
// CHECK-COUNT-3: warp.load
// CHECK: warp.accumulate %{{.*}} {unique = 1 : i64}
// CHECK-NOT: warp.accumulate
// CHECK-LABEL: func.func @clamped
// CHECK: %[[I:.*]] = warp.tid : si32
// CHECK: %[[BEFORE:.*]] = warp.sub(%[[I]]
// CHECK: %[[LEAST:.*]] = warp.max(%[[BEFORE]]
// CHECK: %[[AFTER:.*]] = warp.add(%[[I]]
// CHECK: %[[MOST:.*]] = warp.min(%[[AFTER]], %[[END:.*]])
// CHECK: %[[IN:.*]] = warp.le(%[[AFTER]], %[[END]])
// CHECK: scf.if %[[IN]] {
// CHECK-NEXT: } else {
// CHECK-NEXT: warp.accumulate %{{.*}}, %{{.*}}[%[[MOST]]]
// CHECK: %[[IN:.*]] = warp.ge(%[[BEFORE]]
// CHECK: scf.if %[[IN]] {
// CHECK-NEXT: } else {
// CHECK-NEXT: warp.accumulate %{{.*}}, %{{.*}}[%[[LEAST]]]
// CHECK-NOT: warp.accumulate
func.func @clamped(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: si32)
    attributes {warp.kernel} {
  %zero = warp.constant 0 : si32
  %one = warp.constant 1 : si32
  %i = warp.tid : si32
  %gx = warp.grad %x : !warp.array<1 x f32> -> !warp.array<1 x f32>
  %v = warp.load %y[%i] : !warp.array<1 x f32>, si32 -> f32
  %before = warp.sub(%i, %one) : (si32, si32) -> si32
  %least = warp.max(%before, %zero) : (si32, si32) -> si32
  %after = warp.add(%i, %one) : (si32, si32) -> si32
  %end = warp.sub(%n, %one) : (si32, si32) -> si32
  %most = warp.min(%after, %end) : (si32, si32) -> si32
  warp.accumulate %v, %gx[%most] : f32, !warp.array<1 x f32>, si32
  warp.accumulate %v, %gx[%i] : f32, !warp.array<1 x f32>, si32
  warp.accumulate %v, %gx[%least] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// One condition for both bounds of both indices.
// CHECK-LABEL: func.func @plane_sums
// CHECK-LABEL: func.func @plane
// CHECK: scf.if
// CHECK-NEXT: } else {
// CHECK-NEXT: warp.accumulate
// CHECK-NOT: warp.accumulate
func.func @plane(%x: !warp.array<2 x f32>, %y: !warp.array<2 x f32>, %n: si32)
    attributes {warp.kernel} {
  %zero = warp.constant 0 : si32
  %one = warp.constant 1 : si32
  %i, %j = warp.tid : si32, si32
  %gx = warp.grad %x : !warp.array<2 x f32> -> !warp.array<2 x f32>
  %v = warp.load %y[%i, %j] : !warp.array<2 x f32>, si32, si32 -> f32
  %a = warp.sub(%i, %one) : (si32, si32) -> si32
  %b = warp.add(%j, %one) : (si32, si32) -> si32
  %end = warp.sub(%n, %one) : (si32, si32) -> si32
  %p = warp.clamp(%a, %zero, %end) : (si32, si32, si32) -> si32
  %low = warp.max(%b, %zero) : (si32, si32) -> si32
  %q = warp.min(%low, %end) : (si32, si32) -> si32
  warp.accumulate %v, %gx[%p, %q] : f32, !warp.array<2 x f32>, si32, si32
  warp.accumulate %v, %gx[%i, %j] : f32, !warp.array<2 x f32>, si32, si32
  return
}

// -----

// A bound that differs between threads leaves no constant distance.
// CHECK-LABEL: func.func @own_bound
// CHECK-NOT: warp.halo
func.func @own_bound(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %b: !warp.array<1 x si32>)
    attributes {warp.kernel} {
  %one = warp.constant 1 : si32
  %i = warp.tid : si32
  %gx = warp.grad %x : !warp.array<1 x f32> -> !warp.array<1 x f32>
  %v = warp.load %y[%i] : !warp.array<1 x f32>, si32 -> f32
  %end = warp.load %b[%i] : !warp.array<1 x si32>, si32 -> si32
  %after = warp.add(%i, %one) : (si32, si32) -> si32
  %most = warp.min(%after, %end) : (si32, si32) -> si32
  warp.accumulate %v, %gx[%most] : f32, !warp.array<1 x f32>, si32
  warp.accumulate %v, %gx[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// Elements that are not near the thread's own would be loaded for each
// neighbour.
// CHECK-LABEL: func.func @scattered
// CHECK-NOT: warp.halo
// CHECK-NOT: scf.if
func.func @scattered(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %b: !warp.array<1 x si32>, %n: si32)
    attributes {warp.kernel} {
  %one = warp.constant 1 : si32
  %i = warp.tid : si32
  %gx = warp.grad %x : !warp.array<1 x f32> -> !warp.array<1 x f32>
  %k = warp.load %b[%i] : !warp.array<1 x si32>, si32 -> si32
  %v = warp.load %y[%k] : !warp.array<1 x f32>, si32 -> f32
  %after = warp.add(%i, %one) : (si32, si32) -> si32
  %most = warp.min(%after, %n) : (si32, si32) -> si32
  warp.accumulate %v, %gx[%most] : f32, !warp.array<1 x f32>, si32
  warp.accumulate %v, %gx[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// A function would be called for each neighbour.
// CHECK-LABEL: func.func @function
// CHECK-NOT: warp.halo
// CHECK-NOT: scf.if
func.func @function(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: si32)
    attributes {warp.kernel} {
  %one = warp.constant 1 : si32
  %i = warp.tid : si32
  %gx = warp.grad %x : !warp.array<1 x f32> -> !warp.array<1 x f32>
  %v = warp.load %y[%i] : !warp.array<1 x f32>, si32 -> f32
  %w = warp.sin(%v) : (f32) -> f32
  %after = warp.add(%i, %one) : (si32, si32) -> si32
  %most = warp.min(%after, %n) : (si32, si32) -> si32
  warp.accumulate %w, %gx[%most] : f32, !warp.array<1 x f32>, si32
  warp.accumulate %w, %gx[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// Periodic indices, of an extent that the program knows or not: the threads at
// the end of the period add by themselves.
// CHECK-LABEL: func.func @periodic_sums
// CHECK-SAME: warp.halo = array<i64: 1>
// CHECK: warp.accumulate %{{.*}} {unique = 1 : i64}
// CHECK-NOT: warp.accumulate
// CHECK-LABEL: func.func @periodic
// CHECK: %[[BEFORE:.*]] = warp.mod(%[[FROM:.*]], %arg2)
// CHECK: %[[AFTER:.*]] = warp.mod(%[[TO:.*]], %arg2)
// CHECK: warp.ge(%[[TO]]
// CHECK: warp.lt(%[[TO]], %arg2)
// CHECK: scf.if
// CHECK-NEXT: } else {
// CHECK-NEXT: warp.accumulate %{{.*}}, %{{.*}}[%[[AFTER]]]
// CHECK: %[[REAL:.*]] = warp.sub(%[[FROM]], %arg2)
// CHECK: warp.ge(%[[REAL]]
// CHECK: warp.lt(%[[REAL]], %arg2)
// CHECK: scf.if
// CHECK-NEXT: } else {
// CHECK-NEXT: warp.accumulate %{{.*}}, %{{.*}}[%[[BEFORE]]]
// CHECK-NOT: warp.accumulate
func.func @periodic(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: si32)
    attributes {warp.kernel} {
  %one = warp.constant 1 : si32
  %i = warp.tid : si32
  %gx = warp.grad %x : !warp.array<1 x f32> -> !warp.array<1 x f32>
  %v = warp.load %y[%i] : !warp.array<1 x f32>, si32 -> f32
  %sum = warp.add(%i, %n) : (si32, si32) -> si32
  %from = warp.sub(%sum, %one) : (si32, si32) -> si32
  %before = warp.mod(%from, %n) : (si32, si32) -> si32
  %to = warp.add(%i, %one) : (si32, si32) -> si32
  %after = warp.mod(%to, %n) : (si32, si32) -> si32
  warp.accumulate %v, %gx[%after] : f32, !warp.array<1 x f32>, si32
  warp.accumulate %v, %gx[%i] : f32, !warp.array<1 x f32>, si32
  warp.accumulate %v, %gx[%before] : f32, !warp.array<1 x f32>, si32
  return
}

// RUN: warp-opt %s --split-input-file --warp-form-launch \
// RUN:     --warp-plan-updates --warp-combine-over-groups | FileCheck %s --implicit-check-not=warp.once

#cpu = #warp.variant<target = <name = "cpu", bits = 256>>

// A thread that reads the array finds its own update there.
// CHECK-LABEL: func.func @read_back
// CHECK: warp.atomic_components
// CHECK: warp.load_components %arg1
func.func @read_back(%x: !warp.array<1 x f32>, %sum: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %old = warp.atomic_components add(%v), %sum[%c0]
    : (f32), !warp.array<1 x f32>, i32 -> f32
  %now = warp.load_components %sum[%c0] : !warp.array<1 x f32>, i32 -> f32
  warp.store_components(%now), %x[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>>

// The old value tells threads apart.
// CHECK-LABEL: func.func @ticket
// CHECK: warp.atomic_components
func.func @ticket(%x: !warp.array<1 x si32>, %next: !warp.array<1 x si32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %old = warp.atomic_components add(%i), %next[%c0]
    : (i32), !warp.array<1 x si32>, i32 -> i32
  warp.store_components(%old), %x[%i] : (i32), !warp.array<1 x si32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>>

// The last exchange counts, not a combination of all.
// CHECK-LABEL: func.func @exchange
// CHECK: warp.atomic_components exch
func.func @exchange(%last: !warp.array<1 x si32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %old = warp.atomic_components exch(%i), %last[%c0]
    : (i32), !warp.array<1 x si32>, i32 -> i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>>

// Elements that differ from thread to thread.
// CHECK-LABEL: func.func @scatter
// CHECK: warp.atomic_components
func.func @scatter(%at: !warp.array<1 x si32>, %sum: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %one = arith.constant 1.0 : f32
  %j = warp.load_components %at[%i] : !warp.array<1 x si32>, i32 -> i32
  %old = warp.atomic_components add(%one), %sum[%j]
    : (f32), !warp.array<1 x f32>, i32 -> f32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>>

// Partial sums of 16 bits would round.
// CHECK-LABEL: func.func @half
// CHECK: warp.atomic_components
func.func @half(%x: !warp.array<1 x f16>, %sum: !warp.array<1 x f16>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f16>, i32 -> f16
  %old = warp.atomic_components add(%v), %sum[%c0]
    : (f16), !warp.array<1 x f16>, i32 -> f16
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, debug = true>

// A debugging launch names the thread that fails.
// CHECK-LABEL: func.func @debugging
// CHECK: warp.atomic_components
func.func @debugging(%x: !warp.array<1 x f32>, %sum: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %old = warp.atomic_components add(%v), %sum[%c0]
    : (f32), !warp.array<1 x f32>, i32 -> f32
  return
}

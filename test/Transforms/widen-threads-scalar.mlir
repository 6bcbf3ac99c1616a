// RUN: warp-opt %s --split-input-file --warp-form-launch --warp-widen-threads \
// RUN:   | FileCheck %s --implicit-check-not=vector
// RUN: sed 's/, lanes = 4//' %s \
// RUN:   | warp-opt --split-input-file --warp-form-launch --warp-widen-threads \
// RUN:   | FileCheck %s --implicit-check-not=vector

#lanes = #warp.variant<target = <name = "cpu", bits = 256>, lanes = 4>

// Threads that take a lock one after the other: the lane that has it would wait
// for those that wait for it.
// CHECK-LABEL: func.func @spin
// CHECK: scf.while
func.func @spin(%lock: !warp.array<1 x si32>, %x: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #lanes} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  scf.while : () -> () {
    %old = warp.atomic_components exch(%c1), %lock[%c0]
      : (i32), !warp.array<1 x si32>, i32 -> i32
    %taken = arith.cmpi ne, %old, %c0 : i32
    scf.condition(%taken)
  } do {
    scf.yield
  }
  %v = warp.load_components %x[%c0] : !warp.array<1 x f32>, i32 -> f32
  warp.store_components(%v), %x[%c0] : (f32), !warp.array<1 x f32>, i32
  warp.store_components(%c0), %lock[%c0] : (i32), !warp.array<1 x si32>, i32
  return
}

// -----

#lanes = #warp.variant<target = <name = "cpu", bits = 256>, lanes = 4>

// A thread may wait for a flag that another one stores, also where the
// condition gets to know of it by what an iteration leaves to the next.
// CHECK-LABEL: func.func @flag
// CHECK: scf.while
func.func @flag(%flags: !warp.array<1 x si32>)
    attributes {warp.kernel, warp.variant = #lanes} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %before = arith.subi %i, %c1 : i32
  %done = scf.while (%f = %c0) : (i32) -> i32 {
    %wait = arith.cmpi eq, %f, %c0 : i32
    scf.condition(%wait) %f : i32
  } do {
  ^bb0(%f: i32):
    %now = warp.load_components %flags[%before]
      : !warp.array<1 x si32>, i32 -> i32
    scf.yield %now : i32
  }
  warp.store_components(%c1), %flags[%i] : (i32), !warp.array<1 x si32>, i32
  return
}

// -----

#lanes = #warp.variant<target = <name = "cpu", bits = 256>, lanes = 4>

// Which array a thread reads differs from thread to thread.
// CHECK-LABEL: func.func @arrays
// CHECK: arith.select
func.func @arrays(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>,
                  %z: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #lanes} {
  %i = warp.tid : i32
  %c1 = arith.constant 1 : i32
  %odd = arith.andi %i, %c1 : i32
  %is_odd = arith.cmpi eq, %odd, %c1 : i32
  %a = arith.select %is_odd, %x, %y : !warp.array<1 x f32>
  %v = warp.load_components %a[%i] : !warp.array<1 x f32>, i32 -> f32
  warp.store_components(%v), %z[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 1,
      lanes = 4, debug = true>

// A debugging launch names the thread that fails.
// CHECK-LABEL: func.func @debugging
// CHECK: warp.load_components
func.func @debugging(%x: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  warp.store_components(%v), %x[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, packed = 1,
      lanes = 4>

// Threads of a GPU are lanes of a warp already.
// CHECK-LABEL: func.func @on_gpu
// CHECK: warp.load_components
func.func @on_gpu(%x: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #gpu} {
  %i = warp.tid : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  warp.store_components(%v), %x[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#lanes = #warp.variant<target = <name = "cpu", bits = 256>, lanes = 4>

// The values in the thread's own memory may come from another one, too.
// CHECK-LABEL: func.func @noted
// CHECK: scf.while
func.func @noted(%flags: !warp.array<1 x si32>)
    attributes {warp.kernel, warp.variant = #lanes} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %before = arith.subi %i, %c1 : i32
  %notes = warp.scratch : !warp.scratch<2 x i32>
  warp.scratch_store %c0, %notes[%c1] : i32, !warp.scratch<2 x i32>, i32
  scf.while : () -> () {
    %note = warp.scratch_load %notes[%c1] : !warp.scratch<2 x i32>, i32 -> i32
    %wait = arith.cmpi eq, %note, %c0 : i32
    scf.condition(%wait)
  } do {
    %now = warp.load_components %flags[%before]
      : !warp.array<1 x si32>, i32 -> i32
    %is_there = arith.cmpi ne, %now, %c0 : i32
    scf.if %is_there {
      warp.scratch_store %c1, %notes[%c1] : i32, !warp.scratch<2 x i32>, i32
    }
    scf.yield
  }
  warp.store_components(%c1), %flags[%i] : (i32), !warp.array<1 x si32>, i32
  return
}

// -----

#lanes = #warp.variant<target = <name = "cpu", bits = 256>, lanes = 4, deterministic = true, ordered = true>

// Threads of a deterministic launch get places in a list in their order, those
// of both branches.
// CHECK-LABEL: func.func @places
// CHECK: scf.if
func.func @places(%kind: !warp.array<1 x i1>, %used: !warp.array<1 x si32>,
                  %place: !warp.array<1 x si32>)
    attributes {warp.kernel, warp.variant = #lanes} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %c3 = arith.constant 3 : i32
  %k = warp.load_components %kind[%i] : !warp.array<1 x i1>, i32 -> i1
  %p = scf.if %k -> (i32) {
    %a = warp.atomic_components add(%c3), %used[%c0]
      : (i32), !warp.array<1 x si32>, i32 -> i32
    scf.yield %a : i32
  } else {
    %b = warp.atomic_components add(%c1), %used[%c0]
      : (i32), !warp.array<1 x si32>, i32 -> i32
    scf.yield %b : i32
  }
  warp.store_components(%p), %place[%i] : (i32), !warp.array<1 x si32>, i32
  return
}

// RUN: warp-opt %s --split-input-file --warp-form-launch --warp-plan-updates --warp-apply-schedules --warp-emit-entry --warp-apply-schedules=stage=updates \
// RUN:   | FileCheck %s --implicit-check-not=gpu.shuffle

#gpu = #warp.variant<target = <name = "sm_90">>

// Threads go through different iterations.
// CHECK-LABEL: llvm.func {{.*}}@own_bounds
// CHECK: scf.for
// CHECK-NOT: scf.for
func.func @own_bounds(
    %x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : i32
  scf.for %j = %c0 to %i step %c1 : i32 {
    %v = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
    %old = warp.atomic_components add(%v), %y[%j]
      : (f32), !warp.array<1 x f32>, i32 -> f32
  }
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">>

// Threads update different elements.
// CHECK-LABEL: llvm.func {{.*}}@own_element
// CHECK: scf.for
// CHECK-NOT: scf.for
func.func @own_element(
    %x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : i32
  scf.for %j = %c0 to %n step %c1 : i32 {
    %v = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
    %at = arith.addi %i, %j : i32
    %old = warp.atomic_components add(%v), %y[%at]
      : (f32), !warp.array<1 x f32>, i32 -> f32
  }
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">>

// Iterations update one element.
// CHECK-LABEL: llvm.func {{.*}}@one_element
// CHECK: scf.for
// CHECK-NOT: scf.for
func.func @one_element(
    %x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : i32
  scf.for %j = %c0 to %n step %c1 : i32 {
    %v = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
    %old = warp.atomic_components add(%v), %y[%n]
      : (f32), !warp.array<1 x f32>, i32 -> f32
  }
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">>

// Neighbours update neighbours, as in the adjoint of a matrix product, and would
// not any more.
// CHECK-LABEL: llvm.func {{.*}}@scattered
// CHECK: scf.for
// CHECK-NOT: scf.for
func.func @scattered(
    %x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : i32
  scf.for %j = %c0 to %n step %c1 : i32 {
    %v = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
    %old = warp.atomic_components add(%v), %y[%j]
      : (f32), !warp.array<1 x f32>, i32 -> f32
    %to = arith.addi %i, %j : i32
    %other = warp.atomic_components add(%v), %y[%to]
      : (f32), !warp.array<1 x f32>, i32 -> f32
  }
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">>

// The old value says in which order threads came.
// CHECK-LABEL: llvm.func {{.*}}@old_value
// CHECK: scf.for
// CHECK-NOT: scf.for
func.func @old_value(
    %x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : i32
  scf.for %j = %c0 to %n step %c1 : i32 {
    %v = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
    %old = warp.atomic_components add(%v), %y[%j]
      : (f32), !warp.array<1 x f32>, i32 -> f32
    warp.store_components(%old), %x[%j] : (f32), !warp.array<1 x f32>, i32
  }
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">>

// Another iteration, or thread, could read what this one stores.
// CHECK-LABEL: llvm.func {{.*}}@store
// CHECK: scf.for
// CHECK-NOT: scf.for
func.func @store(
    %x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : i32
  scf.for %j = %c0 to %n step %c1 : i32 {
    %v = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
    %old = warp.atomic_components add(%v), %y[%j]
      : (f32), !warp.array<1 x f32>, i32 -> f32
    warp.store_components(%v), %x[%j] : (f32), !warp.array<1 x f32>, i32
  }
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">>

// Exchanges do not commute.
// CHECK-LABEL: llvm.func {{.*}}@exchange
// CHECK: scf.for
// CHECK-NOT: scf.for
func.func @exchange(
    %x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : i32
  scf.for %j = %c0 to %n step %c1 : i32 {
    %v = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
    %old = warp.atomic_components exch(%v), %y[%j]
      : (f32), !warp.array<1 x f32>, i32 -> f32
  }
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">>

// The kernel looks at what it adds up.
// CHECK-LABEL: llvm.func {{.*}}@read_back
// CHECK: scf.for
// CHECK-NOT: scf.for
func.func @read_back(
    %x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : i32
  scf.for %j = %c0 to %n step %c1 : i32 {
    %v = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
    %old = warp.atomic_components add(%v), %y[%j]
      : (f32), !warp.array<1 x f32>, i32 -> f32
  }
  %now = warp.load_components %y[%i] : !warp.array<1 x f32>, i32 -> f32
  warp.store_components(%now), %x[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">>

// A sum of floats keeps its order unless that is declared open.
// CHECK-LABEL: llvm.func {{.*}}@ordered_sum
// CHECK: scf.for
// CHECK-NOT: scf.for
func.func @ordered_sum(
    %x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %zero = arith.constant 0.0 : f32
  %i = warp.tid : i32
  %r = scf.for %j = %c0 to %n step %c1 iter_args(%s = %zero)
      -> f32 : i32 {
    %v = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
    %old = warp.atomic_components add(%v), %y[%j]
      : (f32), !warp.array<1 x f32>, i32 -> f32
    %t = arith.addf %s, %v : f32
    scf.yield %t : f32
  }
  warp.store_components(%r), %x[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">>

// The partial sum is read on the way.
// CHECK-LABEL: llvm.func {{.*}}@observed_sum
// CHECK: scf.for
// CHECK-NOT: scf.for
func.func @observed_sum(
    %x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %zero = arith.constant 0.0 : f32
  %i = warp.tid : i32
  %r = scf.for %j = %c0 to %n step %c1 iter_args(%s = %zero)
      -> f32 : i32 {
    %v = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
    %old = warp.atomic_components add(%s), %y[%j]
      : (f32), !warp.array<1 x f32>, i32 -> f32
    %t = arith.addf %s, %v fastmath<reassoc> : f32
    scf.yield %t : f32
  }
  warp.store_components(%r), %x[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">>

// An iteration needs the one before.
// CHECK-LABEL: llvm.func {{.*}}@state
// CHECK: scf.for
// CHECK-NOT: scf.for
func.func @state(
    %x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %zero = arith.constant 0.0 : f32
  %i = warp.tid : i32
  %r = scf.for %j = %c0 to %n step %c1 iter_args(%s = %zero)
      -> f32 : i32 {
    %v = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
    %old = warp.atomic_components add(%v), %y[%j]
      : (f32), !warp.array<1 x f32>, i32 -> f32
    scf.yield %v : f32
  }
  warp.store_components(%r), %x[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">>

// Fewer than two tiles are not worth it.
// CHECK-LABEL: llvm.func {{.*}}@short
// CHECK: scf.for
// CHECK-NOT: scf.for
func.func @short(
    %x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %c63 = arith.constant 63 : i32
  %i = warp.tid : i32
  scf.for %j = %c0 to %c63 step %c1 : i32 {
    %v = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
    %old = warp.atomic_components add(%v), %y[%j]
      : (f32), !warp.array<1 x f32>, i32 -> f32
  }
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">>

// Iterations of a tile are neighbours.
// CHECK-LABEL: llvm.func {{.*}}@every_other
// CHECK: scf.for
// CHECK-NOT: scf.for
func.func @every_other(
    %x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %c2 = arith.constant 2 : i32
  %i = warp.tid : i32
  scf.for %j = %c0 to %n step %c2 : i32 {
    %v = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
    %old = warp.atomic_components add(%v), %y[%j]
      : (f32), !warp.array<1 x f32>, i32 -> f32
  }
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">>

// Partial sums of 16 bits would round.
// CHECK-LABEL: llvm.func {{.*}}@narrow
// CHECK: scf.for
// CHECK-NOT: scf.for
func.func @narrow(
    %x: !warp.array<1 x f32>, %y: !warp.array<1 x f16>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : i32
  scf.for %j = %c0 to %n step %c1 : i32 {
    %v = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
    %w = arith.truncf %v : f32 to f16
    %old = warp.atomic_components add(%w), %y[%j]
      : (f16), !warp.array<1 x f16>, i32 -> f16
  }
  return
}

// -----

#gpu2 = #warp.variant<target = <name = "sm_90">, debug = true>

// A debugging launch names the thread that fails.
// CHECK-LABEL: llvm.func {{.*}}@debugging
// CHECK: scf.for
// CHECK-NOT: scf.for
func.func @debugging(
    %x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu2} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : i32
  scf.for %j = %c0 to %n step %c1 : i32 {
    %v = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
    %old = warp.atomic_components add(%v), %y[%j]
      : (f32), !warp.array<1 x f32>, i32 -> f32
  }
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 128>>

// Threads of a CPU are no warp: the outer loop is the one over them.
// CHECK-LABEL: llvm.func {{.*}}@on_cpu
// CHECK: scf.for {{.*}} : i64 {
// CHECK: scf.for {{.*}} : i32 {
// CHECK-NOT: scf.for
func.func @on_cpu(
    %x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : i32
  scf.for %j = %c0 to %n step %c1 : i32 {
    %v = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
    %old = warp.atomic_components add(%v), %y[%j]
      : (f32), !warp.array<1 x f32>, i32 -> f32
  }
  return
}

// RUN: warp-opt %s --split-input-file --warp-form-launch --warp-plan-updates \
// RUN:   | FileCheck %s

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 15, non_negative = 16>

// All threads share element 0; lanes share element k in one iteration, and
// mostly have the same quotient; elements of their own, threads update alone.
// CHECK-LABEL: func.func @scopes
// CHECK: warp.atomic_components add(%{{.*}}), %arg1{{.*}}{warp.update = #warp.update<scope = group>}
// CHECK: warp.atomic_components add(%{{.*}}), %arg2{{.*}}{warp.update = #warp.update<scope = lanes>}
// CHECK: warp.atomic_components add(%{{.*}}), %arg3{{.*}}{warp.update = #warp.update<scope = lanes, run = 32>}
// CHECK: warp.atomic_components add(%{{.*}}), %arg4[
// CHECK-NOT: warp.update
// CHECK: return
func.func @scopes(%x: !warp.array<1 x f32>, %s: !warp.array<1 x f32>,
                  %w: !warp.array<1 x f32>, %q: !warp.array<1 x f32>,
                  %r: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %c32 = arith.constant 32 : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %a = warp.atomic_components add(%v), %s[%c0]
    : (f32), !warp.array<1 x f32>, i32 -> f32
  scf.for %k = %c0 to %n step %c1 : i32 {
    %b = warp.atomic_components add(%v), %w[%k]
      : (f32), !warp.array<1 x f32>, i32 -> f32
  }
  %j = arith.divui %i, %c32 : i32
  %c = warp.atomic_components add(%v), %q[%j]
    : (f32), !warp.array<1 x f32>, i32 -> f32
  %d = warp.atomic_components add(%v), %r[%i]
    : (f32), !warp.array<1 x f32>, i32 -> f32
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, rank = 2>

// On a GPU the sums of a loop's iterations travel in rings, and a warp may lie
// in one row.
// CHECK-LABEL: func.func @gpu
// CHECK: warp.atomic_components add(%{{.*}}), %arg1{{.*}}{warp.update = #warp.update<scope = ring>}
// CHECK: warp.atomic_components add(%{{.*}}), %arg2{{.*}}{warp.update = #warp.update<scope = lanes>}
// CHECK: warp.atomic_components add(%{{.*}}), %arg3{{.*}}{warp.update = #warp.update<scope = group>}
func.func @gpu(%x: !warp.array<1 x f32>, %w: !warp.array<1 x f32>,
               %rows: !warp.array<1 x f32>, %s: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %i, %j = warp.tid : i32, i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %v = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
  scf.for %k = %c0 to %n step %c1 : i32 {
    %b = warp.atomic_components add(%v), %w[%k]
      : (f32), !warp.array<1 x f32>, i32 -> f32
  }
  %c = warp.atomic_components add(%v), %rows[%i]
    : (f32), !warp.array<1 x f32>, i32 -> f32
  %a = warp.atomic_components add(%v), %s[%c0]
    : (f32), !warp.array<1 x f32>, i32 -> f32
  return
}

// -----

#exact = #warp.variant<target = <name = "sm_90">,
                       deterministic = true>

// An exact sum into one element is that of a block.
// CHECK-LABEL: func.func @exact
// CHECK: {warp.update = #warp.update<scope = group, sum = 136>}
func.func @exact(%x: !warp.array<1 x f32>, %s: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #exact} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %a = warp.atomic_components add(%v), %s[%c0]
    : (f32), !warp.array<1 x f32>, i32 -> f32
  return
}

// -----

#debug = #warp.variant<target = <name = "cpu", bits = 256>, debug = true>

// A debugging launch names the thread that fails.
// CHECK-LABEL: func.func @debugging
// CHECK-NOT: warp.update
// CHECK: return
func.func @debugging(%x: !warp.array<1 x f32>, %s: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #debug} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %a = warp.atomic_components add(%v), %s[%c0]
    : (f32), !warp.array<1 x f32>, i32 -> f32
  return
}

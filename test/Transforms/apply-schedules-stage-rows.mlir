// RUN: warp-opt %s --split-input-file --warp-form-launch --warp-apply-schedules --warp-emit-entry --warp-apply-schedules=stage=updates --mlir-print-local-scope | FileCheck %s

#gpu = #warp.variant<target = <name = "sm_90">, disjoint = true>

// A warp loads 16 columns of its 32 rows, two rows at a time, before the
// iterations read them; the loop as it was goes on where the tiles end.
// CHECK-LABEL: llvm.func {{.*}}@sums
// CHECK: %[[X:.*]] = warp.parameter %{{.*}}[24]
// CHECK: llvm.call_intrinsic "llvm.nvvm.activemask"
// CHECK: %[[TILES:.*]] = scf.for
// CHECK: gpu.shuffle idx
// CHECK-COUNT-16: warp.load_components %[[X]]
// CHECK: llvm.nvvm.bar.warp.sync
// CHECK-COUNT-16: llvm.store
// CHECK: llvm.nvvm.bar.warp.sync
// CHECK: scf.for
// CHECK-NOT: warp.load_components
// CHECK: llvm.load
// CHECK: scf.for %[[K:.*]] = %{{.*}} iter_args(%{{.*}} = %[[TILES]])
// CHECK: warp.load_components %[[X]][%{{.*}}, %[[K]]]
func.func @sums(%x: !warp.array<2 x f32>, %y: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %i = warp.tid : i32
  %zero = arith.constant 0.0 : f32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %s = scf.for %k = %c0 to %n step %c1 iter_args(%a = %zero) -> f32 : i32 {
    %v = warp.load_components %x[%i, %k]
      : !warp.array<2 x f32>, i32, i32 -> f32
    %b = arith.addf %a, %v : f32
    scf.yield %b : f32
  }
  warp.store_components(%s), %y[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, disjoint = true>

// A recurrence along a row: the window has one column more than the tile, of
// which the first is loaded and the others are written.
// CHECK-LABEL: llvm.func {{.*}}@recurrence
// CHECK: %[[Q:.*]] = warp.parameter %{{.*}}[24]
// CHECK: scf.for
// CHECK: warp.load_components %[[Q]]
// CHECK-NOT: warp.load_components
// CHECK: scf.for
// CHECK-NOT: components
// CHECK: llvm.load
// CHECK: llvm.store
// CHECK: llvm.nvvm.bar.warp.sync
// CHECK-COUNT-16: warp.store_components
// CHECK: scf.for
func.func @recurrence(%q: !warp.array<2 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %i = warp.tid : i32
  %half = arith.constant 0.5 : f32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  scf.for %k = %c0 to %n step %c1 : i32 {
    %v = warp.load_components %q[%i, %k]
      : !warp.array<2 x f32>, i32, i32 -> f32
    %w = arith.mulf %v, %half : f32
    %next = arith.addi %k, %c1 : i32
    warp.store_components(%w), %q[%i, %next]
      : (f32), !warp.array<2 x f32>, i32, i32
  }
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, disjoint = true>

// Not columns, neighbours, or rows that a branch of the loop writes.
// CHECK-LABEL: llvm.func {{.*}}@unsuited
// CHECK-NOT: activemask
func.func @unsuited(%x: !warp.array<2 x f32>, %y: !warp.array<1 x f32>,
                    %z: !warp.array<2 x f32>, %n: i32, %on: i1)
    attributes {warp.kernel, warp.variant = #gpu} {
  %i = warp.tid : i32
  %zero = arith.constant 0.0 : f32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %a = scf.for %k = %c0 to %n step %c1 iter_args(%s = %zero) -> f32 : i32 {
    %v = warp.load_components %x[%k, %i]
      : !warp.array<2 x f32>, i32, i32 -> f32
    %near = arith.addi %i, %k : i32
    %w = warp.load_components %y[%near] : !warp.array<1 x f32>, i32 -> f32
    %t = warp.load_components %z[%i, %k]
      : !warp.array<2 x f32>, i32, i32 -> f32
    scf.if %on {
      warp.store_components(%v), %z[%i, %k]
        : (f32), !warp.array<2 x f32>, i32, i32
    }
    %sum = arith.addf %s, %v : f32
    %more = arith.addf %sum, %w : f32
    %most = arith.addf %more, %t : f32
    scf.yield %most : f32
  }
  warp.store_components(%a), %y[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#overlap = #warp.variant<target = <name = "sm_90">>

// Nor where what is written may overlap what is read.
// CHECK-LABEL: llvm.func {{.*}}@overlapping
// CHECK-NOT: activemask
func.func @overlapping(%x: !warp.array<2 x f32>, %y: !warp.array<2 x f32>,
                       %n: i32)
    attributes {warp.kernel, warp.variant = #overlap} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  scf.for %k = %c0 to %n step %c1 : i32 {
    %v = warp.load_components %x[%i, %k]
      : !warp.array<2 x f32>, i32, i32 -> f32
    warp.store_components(%v), %y[%i, %k]
      : (f32), !warp.array<2 x f32>, i32, i32
  }
  return
}

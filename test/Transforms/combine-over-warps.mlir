// RUN: warp-opt %s --split-input-file --warp-form-launch --warp-plan-updates --warp-apply-schedules --warp-emit-entry \
// RUN:     --warp-combine-over-warps | FileCheck %s

#gpu = #warp.variant<target = <name = "sm_90">>

// In one iteration all threads update the same element: lanes that are there
// together and agree on the iteration combine, and the first makes one update.
// CHECK-LABEL: llvm.func ptx_kernelcc @parameters
// CHECK: scf.for %[[K:.*]] =
// CHECK: "llvm.nvvm.activemask"
// CHECK: %[[AGREE:.*]] = scf.if {{.*}} -> (i1)
// CHECK: %[[FIRST:.*]], %{{.*}} = gpu.shuffle idx %[[K]], %c0_i32{{.*}}, %{{.*}} : i32
// CHECK: arith.cmpi eq, %[[K]], %[[FIRST]]
// CHECK: "llvm.nvvm.vote.all.sync"
// CHECK: scf.if %[[AGREE]] {
// CHECK-COUNT-5: gpu.shuffle xor {{.*}} : f32
// CHECK: %[[TOTAL:.*]] = arith.addf {{.*}} fastmath<reassoc>
// CHECK: %[[LANE_INDEX:.*]] = gpu.lane_id
// CHECK: %[[LANE:.*]] = arith.index_cast %[[LANE_INDEX]] : index to i32
// CHECK: %[[IS_FIRST:.*]] = arith.cmpi eq, %[[LANE]]
// CHECK: scf.if %[[IS_FIRST]]
// CHECK: warp.atomic_components sub(%[[TOTAL]]), %{{.*}}[%[[K]]]
// CHECK: } else {
// CHECK: warp.atomic_components sub(%[[V:.*]]), %{{.*}}[%[[K]]]
func.func @parameters(%x: !warp.array<1 x f32>, %w: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #gpu} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %c40 = arith.constant 40 : i32
  %i = warp.tid : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  scf.for %k = %c0 to %c40 step %c1 : i32 {
    %old = warp.atomic_components sub(%v), %w[%k]
      : (f32), !warp.array<1 x f32>, i32 -> f32
  }
  return
}

// -----

#gpu2 = #warp.variant<target = <name = "sm_90">, rank = 2>

// Threads of one row of the launch agree on the thread index of axis y.
// CHECK-LABEL: llvm.func ptx_kernelcc @rows
// CHECK: %[[ROW_INDEX:.*]] = gpu.thread_id y
// CHECK: %[[ROW:.*]] = arith.index_cast %[[ROW_INDEX]] : index to i32
// CHECK: gpu.shuffle idx %[[ROW]], %c0_i32{{.*}}, %{{.*}} : i32
// CHECK: "llvm.nvvm.vote.all.sync"
// CHECK-COUNT-10: gpu.shuffle xor {{.*}} : i32
// CHECK-NOT: gpu.shuffle xor
func.func @rows(%x: !warp.array<2 x f64>, %sum: !warp.array<1 x f64>)
    attributes {warp.kernel, warp.variant = #gpu2} {
  %i, %j = warp.tid : i32, i32
  %v = warp.load_components %x[%i, %j] : !warp.array<2 x f64>, i32, i32 -> f64
  %old = warp.atomic_components add(%v), %sum[%i]
    : (f64), !warp.array<1 x f64>, i32 -> f64
  return
}

// -----

#gpu2 = #warp.variant<target = <name = "sm_90">, rank = 2>

// Threads of a row update elements of their own.
// CHECK-LABEL: llvm.func ptx_kernelcc @columns
// CHECK-NOT: gpu.shuffle
func.func @columns(%x: !warp.array<2 x f32>, %sum: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #gpu2} {
  %i, %j = warp.tid : i32, i32
  %v = warp.load_components %x[%i, %j] : !warp.array<2 x f32>, i32, i32 -> f32
  %old = warp.atomic_components add(%v), %sum[%j]
    : (f32), !warp.array<1 x f32>, i32 -> f32
  return
}

// -----

#gpu2 = #warp.variant<target = <name = "sm_90">, rank = 2>

// A thread that reads the array must find its own updates there.
// CHECK-LABEL: llvm.func ptx_kernelcc @read_back
// CHECK-NOT: gpu.shuffle
func.func @read_back(%x: !warp.array<2 x f32>, %sum: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #gpu2} {
  %i, %j = warp.tid : i32, i32
  %v = warp.load_components %x[%i, %j] : !warp.array<2 x f32>, i32, i32 -> f32
  %old = warp.atomic_components add(%v), %sum[%i]
    : (f32), !warp.array<1 x f32>, i32 -> f32
  %now = warp.load_components %sum[%j] : !warp.array<1 x f32>, i32 -> f32
  warp.store_components(%now), %x[%i, %j]
    : (f32), !warp.array<2 x f32>, i32, i32
  return
}

// -----

#gpu3 = #warp.variant<target = <name = "sm_90">, rank = 2,
      debug = true>

// A debugging launch names the thread that fails.
// CHECK-LABEL: llvm.func ptx_kernelcc @debugging
// CHECK-NOT: gpu.shuffle
func.func @debugging(%x: !warp.array<2 x f32>, %sum: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #gpu3} {
  %i, %j = warp.tid : i32, i32
  %v = warp.load_components %x[%i, %j] : !warp.array<2 x f32>, i32, i32 -> f32
  %old = warp.atomic_components add(%v), %sum[%i]
    : (f32), !warp.array<1 x f32>, i32 -> f32
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">>

// Lanes share the components of an element: 4 + 2 + 1 + 1 + 1 exchanges leave each
// of six components to four lanes, the first of which updates it.
// CHECK-LABEL: llvm.func ptx_kernelcc @matrices
// CHECK: scf.if %{{.*}} {
// CHECK: %[[LANE_INDEX:.*]] = gpu.lane_id
// CHECK: %[[LANE:.*]] = arith.index_cast %[[LANE_INDEX]] : index to i32
// CHECK-COUNT-9: gpu.shuffle xor
// CHECK-NOT: gpu.shuffle
// CHECK: %[[TOTAL:.*]] = arith.addf {{.*}} fastmath<reassoc>
// CHECK: %[[NUMBER:.*]] = arith.divui %[[LANE]], %c4_i32
// CHECK: %[[REST:.*]] = arith.remui %[[LANE]], %c4_i32
// CHECK: scf.if
// CHECK: %[[ROW:.*]] = arith.divui %[[AT:.*]], %c3_i32
// CHECK: %[[COLUMN:.*]] = arith.remui %[[AT]], %c3_i32
// CHECK: %[[PART:.*]] = warp.component_view %{{.*}}[%[[ROW]], %[[COLUMN]]]
// CHECK: warp.atomic_components add(%[[TOTAL]]), %[[PART]]
// CHECK: } else {
// CHECK: warp.atomic_components add(%{{.*}}, %{{.*}}, %{{.*}}, %{{.*}}, %{{.*}}, %{{.*}}), %
!m = !warp.mat<2x3 x f32>
func.func @matrices(%x: !warp.array<1 x f32>, %w: !warp.array<1 x !m>)
    attributes {warp.kernel, warp.variant = #gpu} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %c40 = arith.constant 40 : i32
  %i = warp.tid : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  scf.for %k = %c0 to %c40 step %c1 : i32 {
    %old:6 = warp.atomic_components add(%v, %v, %v, %v, %v, %v), %w[%k]
      : (f32, f32, f32, f32, f32, f32), !warp.array<1 x !m>, i32
        -> f32, f32, f32, f32, f32, f32
  }
  return
}

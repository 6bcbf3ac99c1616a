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

// -----

#gpu5 = #warp.variant<target = <name = "sm_90">>

// Lanes that do not take the branch add zeros: the update is behind it, and one
// for the warp if four lanes or more agree on the element, which is loaded.
// CHECK-LABEL: llvm.func ptx_kernelcc @branch
// CHECK: %[[TAKEN:.*]]:3 = scf.if %{{.*}} -> (f32, i32, i1) {
// CHECK: scf.yield %{{.*}}, %{{.*}}, %true
// CHECK: } else {
// CHECK: scf.yield %cst{{.*}}, %c0{{.*}}, %false
// CHECK: %[[LANES:.*]] = llvm.call_intrinsic "llvm.nvvm.vote.ballot.sync"(%{{.*}}, %[[TAKEN]]#2)
// CHECK: %[[COUNT:.*]] = math.ctpop %[[LANES]]
// CHECK: arith.cmpi uge, %[[COUNT]], %c4
// CHECK: %[[FIRST:.*]] = math.cttz %[[LANES]]
// CHECK: gpu.shuffle idx %[[TAKEN]]#1
// CHECK: "llvm.nvvm.vote.all.sync"
// CHECK-COUNT-5: gpu.shuffle xor {{.*}} : f32
// CHECK: warp.atomic_components add
// CHECK: } else {
// CHECK: scf.if %[[TAKEN]]#2 {
// CHECK: warp.atomic_components add(%[[TAKEN]]#0), %{{.*}}[%[[TAKEN]]#1]
func.func @branch(%x: !warp.array<1 x f32>, %order: !warp.array<1 x si32>,
                  %w: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #gpu5} {
  %zero = arith.constant 0.0 : f32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %c40 = arith.constant 40 : i32
  %i = warp.tid : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %some = arith.cmpf ogt, %v, %zero : f32
  scf.for %k = %c0 to %c40 step %c1 : i32 {
    scf.if %some {
      %g = warp.load_components %order[%k] : !warp.array<1 x si32>, i32 -> i32
      %old = warp.atomic_components add(%v), %w[%g]
        : (f32), !warp.array<1 x f32>, i32 -> f32
    }
  }
  return
}

// -----

#gpu6 = #warp.variant<target = <name = "sm_90">>

// Sixteen threads in a row have the same tile: two groups of a warp, each with
// an element of its own.
// CHECK-LABEL: llvm.func ptx_kernelcc @tiles
// CHECK: "llvm.nvvm.vote.ballot.sync"
// CHECK: arith.cmpi uge, %{{.*}}, %c8
// CHECK: %[[BASE:.*]] = arith.andi %{{.*}}, %c-16
// CHECK: arith.shrui %{{.*}}, %[[BASE]]
// CHECK-COUNT-4: gpu.shuffle xor {{.*}} : f32
// CHECK-NOT: gpu.shuffle xor
// CHECK: arith.andi %{{.*}}, %c15
// CHECK: return
func.func @tiles(%x: !warp.array<1 x f32>, %w: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #gpu6} {
  %c16 = arith.constant 16 : i32
  %i = warp.tid : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %tile = arith.divui %i, %c16 : i32
  %old = warp.atomic_components add(%v), %w[%tile]
    : (f32), !warp.array<1 x f32>, i32 -> f32
  return
}

// -----

#gpu7 = #warp.variant<target = <name = "sm_90">>

// A reversed loop begins with the most trips of the lanes that are here, the
// upper halves first.
// CHECK-LABEL: llvm.func ptx_kernelcc @in_step
// CHECK: %[[ACTIVE:.*]] = llvm.call_intrinsic "llvm.nvvm.activemask"
// CHECK: llvm.call_intrinsic "llvm.nvvm.redux.sync.umax"(%{{.*}}, %[[ACTIVE]])
// CHECK: llvm.call_intrinsic "llvm.nvvm.redux.sync.umax"
// CHECK: %[[MOST:.*]] = arith.ori
// CHECK: scf.for %{{.*}} = %{{.*}} to %[[MOST]]
// CHECK-COUNT-5: gpu.shuffle xor {{.*}} : f32
func.func @in_step(%n: !warp.array<1 x si64>, %w: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #gpu7} {
  %one = arith.constant 1.0 : f32
  %c0 = arith.constant 0 : i64
  %c1 = arith.constant 1 : i64
  %i = warp.tid : i32
  %own = warp.load_components %n[%i] : !warp.array<1 x si64>, i32 -> i64
  %most = warp.most_trips %own : i64
  scf.for %k = %c0 to %most step %c1 : i64 {
    %made = arith.cmpi ult, %k, %own {warp.in_step} : i64
    scf.if %made {
      %old = warp.atomic_components add(%one), %w[%k]
        : (f32), !warp.array<1 x f32>, i64 -> f32
    }
  }
  return
}

// -----

#old = #warp.variant<target = <name = "sm_75">>

// Without that instruction each thread makes its own trips.
// CHECK-LABEL: llvm.func ptx_kernelcc @apart
// CHECK-NOT: redux
// CHECK: %[[OWN:.*]] = warp.load_components
// CHECK: scf.for %[[K:.*]] = %{{.*}} to %[[OWN]]
// CHECK-NOT: scf.if
// CHECK: "llvm.nvvm.activemask"
// CHECK: warp.atomic_components add({{.*}}), %{{.*}}[%[[K]]]
func.func @apart(%n: !warp.array<1 x si64>, %w: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #old} {
  %one = arith.constant 1.0 : f32
  %c0 = arith.constant 0 : i64
  %c1 = arith.constant 1 : i64
  %i = warp.tid : i32
  %own = warp.load_components %n[%i] : !warp.array<1 x si64>, i32 -> i64
  %most = warp.most_trips %own : i64
  scf.for %k = %c0 to %most step %c1 : i64 {
    %made = arith.cmpi ult, %k, %own {warp.in_step} : i64
    scf.if %made {
      %old = warp.atomic_components add(%one), %w[%k]
        : (f32), !warp.array<1 x f32>, i64 -> f32
    }
  }
  return
}

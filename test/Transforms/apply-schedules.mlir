// RUN: warp-opt %s --split-input-file --warp-apply-schedules | FileCheck %s

#small = #warp.variant<target = <name = "sm_90">, packed = 3>

// Threads that are mapped to the grid have no indices: they read their place,
// and compare it with the extent of the launch. A schedule that does not pay
// for this launch leaves the fact that it depends on, and its reason.
// CHECK-LABEL: func.func @small
// CHECK-SAME: warp.choices = {{\[}}["coarsening", "1", "the launch is not large", 0]]
// CHECK-SAME: warp.schedule = #warp.schedule<size_facts = 1>
// CHECK: warp.threads attributes
// CHECK-NOT: ^bb0
// CHECK: %[[N:.*]] = warp.launch_extent 0 : i32
// CHECK: gpu.block_id x
// CHECK: gpu.block_dim x
// CHECK: gpu.thread_id x
// CHECK: %[[INSIDE:.*]] = arith.cmpi slt, %[[I:.*]], %[[N]]
// CHECK: scf.if %[[INSIDE]]
// CHECK: warp.store_components(%[[I]]), %{{.*}}[%[[I]]]
// CHECK: warp.yield
func.func @small(%y: !warp.array<1 x si32>) attributes {
    warp.kernel, warp.variant = #small} {
  warp.group {
    warp.threads attributes {kinds = array<i32>, types = []} {
    ^bb0(%i: i32):
      warp.store_components(%i), %y[%i] : (i32), !warp.array<1 x si32>, i32
      warp.yield
    }
  }
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>>

// Threads of a CPU keep their indices.
// CHECK-LABEL: func.func @cpu
// CHECK: ^bb0(%[[I:.*]]: i32):
// CHECK-NEXT: warp.store_components(%[[I]])
func.func @cpu(%y: !warp.array<1 x si32>) attributes {
    warp.kernel, warp.variant = #cpu} {
  warp.group {
    warp.threads attributes {kinds = array<i32>, types = []} {
    ^bb0(%i: i32):
      warp.store_components(%i), %y[%i] : (i32), !warp.array<1 x si32>, i32
      warp.yield
    }
  }
  return
}

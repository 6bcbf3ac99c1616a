// RUN: warp-opt %s --warp-apply-schedules --warp-emit-entry | FileCheck %s

#gpu = #warp.variant<target = <name = "sm_90">, rank = 2>

// A launch of one block: its threads stride over all indices of the launch,
// and their sums are combined in the block's order.
// CHECK-LABEL: llvm.func ptx_kernelcc @block
// CHECK: %[[ROWS:.*]] = warp.parameter %{{.*}}[0] : !llvm.ptr -> i32
// CHECK: %[[COLUMNS:.*]] = warp.parameter %{{.*}}[4] : !llvm.ptr -> i32
// CHECK-NOT: gpu.block_id
// CHECK-DAG: gpu.thread_id x
// CHECK-DAG: gpu.block_dim x
// CHECK: %[[SUM:.*]] = scf.for %[[N:[^ ]+]] = {{.*}} -> (f32)
// CHECK: arith.divui %[[N]]
// CHECK: warp.load_components
// CHECK: arith.addf {{.*}} fastmath<reassoc> : f32
// CHECK-COUNT-5: gpu.shuffle down
// CHECK: gpu.barrier
// CHECK: scf.if
// CHECK: warp.atomic_components add
func.func @block(%x: !warp.array<2 x f32>, %s: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #gpu,
      warp.schedule = #warp.schedule<single_block = 256>} {
  warp.group {
    %sum = warp.threads attributes {kinds = array<i32: 0>, types = [f32]} {
    ^bb0(%j: i32, %i: i32):
      %v = warp.load_components %x[%j, %i]
        : !warp.array<2 x f32>, i32, i32 -> f32
      warp.yield %v : f32
    } : f32
    warp.once {
      %c0 = arith.constant 0 : i32
      %old = warp.atomic_components add(%sum), %s[%c0]
        : (f32), !warp.array<1 x f32>, i32 -> f32
    }
  }
  return
}

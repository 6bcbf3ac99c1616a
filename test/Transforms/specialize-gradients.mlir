// RUN: warp-opt %s --warp-specialize="rank=1" | FileCheck %s
// RUN: warp-opt %s --warp-specialize="rank=2" | FileCheck %s --check-prefix=TWO
// RUN: warp-opt %s --warp-pipeline="to-llvm packed=3" | FileCheck %s --check-prefix=LLVM
// RUN: warp-opt %s --warp-pipeline="to-llvm debug" | FileCheck %s --check-prefix=DEBUG
// RUN: warp-opt %s --warp-pipeline="to-llvm target=sm_90" | FileCheck %s --check-prefix=GPU

// Indices that no two threads share need no atomic. They are unique up to a
// rank of the launch; beyond it, threads conflict.
// CHECK-LABEL: func.func @update
// CHECK: %[[G:.*]] = warp.grad
// CHECK: %[[OLD:.*]] = warp.load %[[G]]
// CHECK: %[[SUM:.*]] = warp.add(%[[OLD]], %{{.*}}) : (f32, f32) -> f32
// CHECK: warp.store %[[SUM]], %[[G]]
// CHECK: warp.atomic add %{{.*}}, %[[G]]
// TWO-LABEL: func.func @update
// TWO-NOT: warp.load
// TWO: warp.atomic add
// TWO: warp.atomic add

// The gradient's pointer is 8 bytes into the descriptor, which lies 24 into
// the parameter block; it is read before the loop over threads, once for the
// threads that are left after it, once for the loop. Elements of 16 bits have
// gradients of 32.
// LLVM-LABEL: llvm.func @update
// LLVM: %[[OF_LAST:.*]] = llvm.getelementptr inbounds %{{.*}}[32]
// LLVM: llvm.load %[[OF_LAST]] invariant {alignment = 8 : i64} : !llvm.ptr -> !llvm.ptr
// LLVM: %[[AT:.*]] = llvm.getelementptr inbounds %{{.*}}[32]
// LLVM: %[[DATA:.*]] = llvm.load %[[AT]] invariant {alignment = 8 : i64} : !llvm.ptr -> !llvm.ptr
// LLVM-NEXT: llvm.br ^bb1
// LLVM: llvm.getelementptr inbounds %[[DATA]][%{{.*}}] : (!llvm.ptr, i64) -> !llvm.ptr, f32

// A debugging launch names the array and its gradient.
// DEBUG: "h.grad"

// GPU: llvm.load %{{.*}} invariant {alignment = 8 : i64} : !llvm.ptr -> !llvm.ptr<1>
// GPU: llvm.atomicrmw fadd
func.func @update(%h: !warp.array<1 x f16>, %x: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.arg_names = ["h", "x"]} {
  %i = warp.tid : si32
  %g = warp.grad %h : !warp.array<1 x f16> -> !warp.array<1 x f32>
  %v = warp.constant 1.0 : f32
  %j = warp.constant 2 : si32
  %k = warp.mul(%i, %j) : (si32, si32) -> si32
  %q = warp.div(%i, %j) : (si32, si32) -> si32
  warp.accumulate %v, %g[%k] {unique = 1} : f32, !warp.array<1 x f32>, si32
  warp.accumulate %v, %g[%q] : f32, !warp.array<1 x f32>, si32
  return
}

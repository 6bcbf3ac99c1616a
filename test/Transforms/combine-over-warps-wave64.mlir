// RUN: warp-opt %s --warp-form-launch --warp-plan-updates --warp-apply-schedules --warp-emit-entry \
// RUN:     --warp-combine-over-warps | FileCheck %s

#wave64 = #warp.variant<target = <name = "gfx90a">>

// A subgroup of 64 lanes takes six exchanges, and a ballot of 64 bits says that
// all lanes are there and that they agree.
// CHECK-LABEL: llvm.func @parameters
// CHECK-SAME: llvm.byref = !llvm.array<
// CHECK: scf.for %[[K:.*]] =
// CHECK: %[[HERE:.*]] = llvm.call_intrinsic "llvm.amdgcn.ballot.i64"(%{{.*}}) : (i1) -> i64
// CHECK: arith.cmpi eq, %[[HERE]], %{{.*}} : i64
// CHECK: %[[WIDTH:.*]] = arith.constant 64 : i32
// CHECK: gpu.shuffle idx %[[K]], %{{.*}}, %[[WIDTH]] : i32
// CHECK: llvm.call_intrinsic "llvm.amdgcn.ballot.i64"
// CHECK-COUNT-6: gpu.shuffle xor {{.*}} : f32
// CHECK-NOT: gpu.shuffle
func.func @parameters(%x: !warp.array<1 x f32>, %w: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #wave64} {
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

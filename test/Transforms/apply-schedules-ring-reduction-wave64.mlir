// RUN: warp-opt %s --warp-form-launch --warp-plan-updates --warp-apply-schedules --warp-emit-entry --warp-apply-schedules=stage=updates \
// RUN:   | FileCheck %s

#wave64 = #warp.variant<target = <name = "gfx90a">>

// A tile has 64 iterations, and the mask of those that updated 64 bits.
// CHECK-LABEL: llvm.func @guarded
// CHECK: %[[REACHED:.*]] = llvm.alloca {{.*}} x i64
// CHECK: arith.andi %{{.*}}, %c-64_i32
// CHECK: scf.for %{{.*}} = %{{.*}} to %{{.*}} step %c64_i32
// CHECK: llvm.store %c0_i64{{.*}}, %[[REACHED]] : i64
// CHECK: scf.for %{{.*}} = %c0_i32{{.*}} to %c64_i32
// CHECK: %[[OFFSET:.*]] = arith.andi %{{.*}}, %c63_i32
// CHECK: %[[WIDE:.*]] = arith.extui %[[OFFSET]] : i32 to i64
// CHECK: %[[BIT:.*]] = arith.shli %c1_i64{{.*}}, %[[WIDE]] : i64
// CHECK: llvm.store %{{.*}}, %[[REACHED]] : i64
// CHECK: arith.shrui %{{.*}}, %{{.*}} : i64
func.func @guarded(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #wave64} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : i32
  %xi = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  scf.for %j = %c0 to %n step %c1 : i32 {
    %xj = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
    %v = arith.subf %xi, %xj : f32
    %other = arith.cmpi ne, %i, %j : i32
    scf.if %other {
      %old = warp.atomic_components add(%v), %y[%j]
        : (f32), !warp.array<1 x f32>, i32 -> f32
    }
  }
  return
}

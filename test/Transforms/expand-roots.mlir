// RUN: warp-opt %s --split-input-file --warp-form-launch --warp-apply-schedules --warp-emit-entry --warp-expand-roots | FileCheck %s

#gpu = #warp.variant<target = <name = "sm_90">>

// A root in a loop, and a reciprocal of one that has no other use. The root
// that nothing waits for stays.
// CHECK-LABEL: llvm.func {{.*}}@roots
// CHECK: math.sqrt
// CHECK: scf.for
// CHECK: llvm.call_intrinsic "llvm.nvvm.rsqrt.approx.ftz.f"
// CHECK: scf.yield
// CHECK-NOT: math.sqrt
// CHECK-NOT: arith.divf
// CHECK: llvm.call_intrinsic "llvm.nvvm.rsqrt.approx.f"
// CHECK-NOT: llvm.nvvm.rsqrt
// CHECK: llvm.return
func.func @roots(%x: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %i = warp.tid : i32
  %one = arith.constant 1.0 : f32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %s = math.sqrt %v : f32
  %t = scf.for %j = %c0 to %n step %c1 iter_args(%a = %s) -> f32 : i32 {
    %b = math.sqrt %a : f32
    scf.yield %b : f32
  }
  %u = math.sqrt %t : f32
  %r = arith.divf %one, %u : f32
  warp.store_components(%r), %x[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, fast_math = true>

// Fast math is the approximation itself.
// CHECK-LABEL: llvm.func {{.*}}@fast
// CHECK: %[[Y:.*]] = llvm.call_intrinsic "llvm.nvvm.rsqrt.approx.ftz.f"
// CHECK-NEXT: warp.store_components(%[[Y]])
func.func @fast(%x: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #gpu} {
  %i = warp.tid : i32
  %one = arith.constant 1.0 : f32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %s = math.sqrt %v : f32
  %r = arith.divf %one, %s : f32
  warp.store_components(%r), %x[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">>

// Doubles, and processors, have instructions for it.
// CHECK-LABEL: llvm.func {{.*}}@double
// CHECK: math.sqrt
// CHECK-NOT: rsqrt
func.func @double(%x: !warp.array<1 x f64>)
    attributes {warp.kernel, warp.variant = #gpu} {
  %i = warp.tid : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f64>, i32 -> f64
  %s = math.sqrt %v : f64
  warp.store_components(%s), %x[%i] : (f64), !warp.array<1 x f64>, i32
  return
}

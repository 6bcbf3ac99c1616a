// RUN: warp-opt %s --split-input-file --warp-lower-launch --warp-lower-arrays | FileCheck %s

#cpu = #warp.variant<target = <platform = cpu, bits = 128>, index32 = false>

// A component is read before, another after, a write that may be to the same
// element: the loop is not marked, or lanes would read the second one early.
// CHECK-LABEL: llvm.func @between
// CHECK-NOT: access_groups
// CHECK: llvm.return
func.func @between(%x: !warp.array<1 x !warp.vec<2 x f32>>,
                   %y: !warp.array<1 x !warp.vec<2 x f32>>,
                   %z: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %x0 = warp.component_view %x[%c0]
    : !warp.array<1 x !warp.vec<2 x f32>>, i32 -> !warp.array<1 x f32>
  %x1 = warp.component_view %x[%c1]
    : !warp.array<1 x !warp.vec<2 x f32>>, i32 -> !warp.array<1 x f32>
  %y1 = warp.component_view %y[%c1]
    : !warp.array<1 x !warp.vec<2 x f32>>, i32 -> !warp.array<1 x f32>
  %a = warp.load_components %x0[%i] : !warp.array<1 x f32>, i32 -> f32
  warp.store_components(%a), %y1[%i] : (f32), !warp.array<1 x f32>, i32
  %b = warp.load_components %x1[%i] : !warp.array<1 x f32>, i32 -> f32
  warp.store_components(%b), %z[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <platform = cpu, bits = 128>, index32 = false>

// What a thread has just stored is not loaded again, and then the order of
// loads and stores is harmless.
// CHECK-LABEL: llvm.func @forward
// CHECK-COUNT-4: llvm.load %{{.*}} {access_groups
// CHECK-NOT: llvm.load %{{.*}} {access_groups
// CHECK: llvm.return
func.func @forward(%x: !warp.array<1 x !warp.vec<2 x f32>>,
                   %v: !warp.array<1 x !warp.vec<2 x f32>>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %v0, %v1 = warp.load_components %v[%i]
    : !warp.array<1 x !warp.vec<2 x f32>>, i32 -> f32, f32
  warp.store_components(%v1, %v0), %v[%i]
    : (f32, f32), !warp.array<1 x !warp.vec<2 x f32>>, i32
  %x0, %x1 = warp.load_components %x[%i]
    : !warp.array<1 x !warp.vec<2 x f32>>, i32 -> f32, f32
  %w0, %w1 = warp.load_components %v[%i]
    : !warp.array<1 x !warp.vec<2 x f32>>, i32 -> f32, f32
  %a = arith.addf %w0, %x0 : f32
  %b = arith.addf %w1, %x1 : f32
  warp.store_components(%a, %b), %x[%i]
    : (f32, f32), !warp.array<1 x !warp.vec<2 x f32>>, i32
  return
}

// -----

#cpu = #warp.variant<target = <platform = cpu, bits = 128>, index32 = false>

// Neighbouring threads that read neighbouring numbers leave nothing to move.
// CHECK-LABEL: llvm.func @dense
// CHECK: llvm.load %{{.*}} {access_groups
// CHECK: llvm.store %{{.*}} {access_groups
// CHECK: llvm.load %{{.*}} {access_groups
// CHECK: llvm.store %{{.*}} {access_groups
func.func @dense(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c1 = arith.constant 1 : i32
  %j = arith.addi %i, %c1 : i32
  %a = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  warp.store_components(%a), %y[%i] : (f32), !warp.array<1 x f32>, i32
  %b = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
  warp.store_components(%b), %y[%j] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <platform = cpu, bits = 128>, index32 = false>

// A loop may be unrolled, so its next iteration follows this one.
// CHECK-LABEL: llvm.func @iterations
// CHECK-NOT: access_groups
// CHECK: llvm.return
func.func @iterations(%x: !warp.array<1 x !warp.vec<2 x f32>>,
                      %y: !warp.array<1 x !warp.vec<2 x f32>>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %c2 = arith.constant 2 : i32
  scf.for %k = %c0 to %c2 step %c1 : i32 {
    %xk = warp.component_view %x[%k]
      : !warp.array<1 x !warp.vec<2 x f32>>, i32 -> !warp.array<1 x f32>
    %yk = warp.component_view %y[%k]
      : !warp.array<1 x !warp.vec<2 x f32>>, i32 -> !warp.array<1 x f32>
    %a = warp.load_components %xk[%i] : !warp.array<1 x f32>, i32 -> f32
    warp.store_components(%a), %yk[%i] : (f32), !warp.array<1 x f32>, i32
  }
  return
}

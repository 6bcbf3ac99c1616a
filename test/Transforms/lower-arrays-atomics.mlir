// RUN: warp-opt %s --split-input-file --warp-lower-arrays | FileCheck %s


// One relaxed update per component; a float is subtracted by adding its
// negative.
// CHECK-LABEL: llvm.func @vector
// CHECK: llvm.atomicrmw fadd %{{.*}}, %{{.*}} monotonic {alignment = 4
// CHECK: %[[MINUS:.*]] = arith.negf
// CHECK: llvm.atomicrmw fadd %{{.*}}, %[[MINUS]] monotonic
llvm.func @vector(%block: !llvm.ptr, %i: i32, %v: f32)
    attributes {warp.entry} {
  %a = warp.parameter %block[24] packed
    : !llvm.ptr -> !warp.array<1 x !warp.vec<1 x f32>>
  %0 = warp.atomic_components add(%v), %a[%i]
    : (f32), !warp.array<1 x !warp.vec<1 x f32>>, i32 -> f32
  %1 = warp.atomic_components sub(%v), %a[%i]
    : (f32), !warp.array<1 x !warp.vec<1 x f32>>, i32 -> f32
  llvm.return
}

// -----

// The element's sign picks the comparison.
// CHECK-LABEL: llvm.func @minima
// CHECK: llvm.atomicrmw min
// CHECK: llvm.atomicrmw umin
// CHECK: llvm.atomicrmw umax
llvm.func @minima(%block: !llvm.ptr, %i: i32, %v: i32)
    attributes {warp.entry} {
  %a = warp.parameter %block[24] : !llvm.ptr -> !warp.array<1 x si32>
  %b = warp.parameter %block[80] : !llvm.ptr -> !warp.array<1 x ui32>
  %0 = warp.atomic_components min(%v), %a[%i]
    : (i32), !warp.array<1 x si32>, i32 -> i32
  %1 = warp.atomic_components min(%v), %b[%i]
    : (i32), !warp.array<1 x ui32>, i32 -> i32
  %2 = warp.atomic_components max(%v), %b[%i]
    : (i32), !warp.array<1 x ui32>, i32 -> i32
  llvm.return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, index32 = false>

// Floats are compared by their bits; the GPU's scope is the device.
// CHECK-LABEL: llvm.func @exchange
// CHECK: %[[OLD:.*]] = arith.bitcast %{{.*}} : f32 to i32
// CHECK: %[[NEW:.*]] = arith.bitcast %{{.*}} : f32 to i32
// CHECK: llvm.cmpxchg %{{.*}}, %[[OLD]], %[[NEW]] syncscope("device") monotonic monotonic
// CHECK: llvm.atomicrmw xchg %{{.*}}, %{{.*}} syncscope("device") monotonic
llvm.func @exchange(%block: !llvm.ptr, %i: i32, %v: f32)
    attributes {warp.entry, warp.variant = #gpu} {
  %a = warp.parameter %block[24] : !llvm.ptr -> !warp.array<1 x f32>
  %0 = warp.atomic_cas %v, %v, %a[%i]
    : f32, f32, !warp.array<1 x f32>, i32 -> f32
  %1 = warp.atomic_components exch(%0), %a[%i]
    : (f32), !warp.array<1 x f32>, i32 -> f32
  llvm.return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, index32 = false>

// A limit of floats that leaves the element as it is exchanges nothing.
// CHECK-LABEL: llvm.func @limit
// CHECK: %[[FIRST:.*]] = llvm.load %{{.*}} atomic syncscope("device") monotonic
// CHECK: scf.while (%[[HELD:.*]] = %[[FIRST]])
// CHECK: %[[LEAST:.*]] = arith.minnumf
// CHECK: %[[MADE:.*]] = llvm.bitcast %[[LEAST]]
// CHECK: %[[CHANGES:.*]] = arith.cmpi ne, %[[MADE]], %[[HELD]]
// CHECK: scf.if %[[CHANGES]]
// CHECK: llvm.cmpxchg %{{.*}}, %[[HELD]], %[[MADE]] syncscope("device")
// CHECK: else
// CHECK-NEXT: scf.yield %[[HELD]], %[[CHANGES]]
llvm.func @limit(%block: !llvm.ptr, %i: i32, %v: f32)
    attributes {warp.entry, warp.variant = #gpu} {
  %a = warp.parameter %block[24] : !llvm.ptr -> !warp.array<1 x f32>
  %0 = warp.atomic_components min(%v), %a[%i]
    : (f32), !warp.array<1 x f32>, i32 -> f32
  llvm.return
}

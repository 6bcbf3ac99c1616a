// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm packed=1" | FileCheck %s

// `i - 1` needs no wrapping where a branch lets only positive `i` pass.
// CHECK-LABEL: llvm.func @inside
// CHECK-NOT: llvm.select
// CHECK: llvm.return
func.func @inside(%x: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %zero = warp.constant 0 : si32
  %one = warp.constant 1 : si32
  %v = warp.constant 2.0 : f32
  %positive = warp.gt(%i, %zero) : (si32, si32) -> i1
  %extent = warp.dim %x, 0 : !warp.array<1 x f32> -> si32
  %fits = warp.lt(%i, %extent) : (si32, si32) -> i1
  %both = warp.bit_and(%positive, %fits) : (i1, i1) -> i1
  scf.if %both {
    %at = warp.sub(%i, %one) : (si32, si32) -> si32
    warp.store %v, %x[%at] : f32, !warp.array<1 x f32>, si32
  }
  return
}

// -----

// Nor after an early return.
// CHECK-LABEL: llvm.func @otherwise
// CHECK-NOT: llvm.select
// CHECK: llvm.return
func.func @otherwise(%x: !warp.array<1 x f32>, %n: si32)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %one = warp.constant 1 : si32
  %v = warp.constant 2.0 : f32
  %low = warp.lt(%i, %one) : (si32, si32) -> i1
  %high = warp.ge(%i, %n) : (si32, si32) -> i1
  %edge = warp.bit_or(%low, %high) : (i1, i1) -> i1
  scf.if %edge {
  } else {
    %at = warp.sub(%i, %one) : (si32, si32) -> si32
    warp.store %v, %x[%at] : f32, !warp.array<1 x f32>, si32
  }
  return
}

// -----

// A guard that is too weak does not count.
// CHECK-LABEL: llvm.func @too_weak
// CHECK: llvm.select
func.func @too_weak(%x: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %zero = warp.constant 0 : si32
  %two = warp.constant 2 : si32
  %v = warp.constant 2.0 : f32
  %positive = warp.gt(%i, %zero) : (si32, si32) -> i1
  scf.if %positive {
    %at = warp.sub(%i, %two) : (si32, si32) -> si32
    warp.store %v, %x[%at] : f32, !warp.array<1 x f32>, si32
  }
  return
}

// RUN: warp-opt %s --warp-lower-composites | FileCheck %s

// Each index comes from counters alone: with the loops written out, the values
// are in registers.
// CHECK-LABEL: func.func @reversed
// CHECK-NOT: scf.for
// CHECK-NOT: warp.scratch
// CHECK-COUNT-12: warp.load
// CHECK: return
func.func @reversed(%a: !warp.array<1 x f32>) {
  %none = warp.construct() : () -> !warp.vec<12 x f32>
  %c11 = warp.constant 11 : si32
  %c2 = warp.constant 2 : si32
  %i0 = arith.constant 0 : i32
  %i1 = arith.constant 1 : i32
  %i12 = arith.constant 12 : i32
  %v = scf.for %i = %i0 to %i12 step %i1 iter_args(%u = %none)
      -> (!warp.vec<12 x f32>) : i32 {
    %k = warp.cast %i : i32 to si32
    %x = warp.load %a[%k] : !warp.array<1 x f32>, si32 -> f32
    %j = warp.sub(%c11, %k) : (si32, si32) -> si32
    %w = warp.insert %x, %u[%j] : f32, !warp.vec<12 x f32>, si32
    scf.yield %w : !warp.vec<12 x f32>
  }
  scf.for %i = %i0 to %i12 step %i1 : i32 {
    %k = warp.cast %i : i32 to si32
    %j = warp.mod(%k, %c2) : (si32, si32) -> si32
    %x = warp.extract %v[%j] : !warp.vec<12 x f32>, si32 -> f32
    warp.store %x, %a[%k] : f32, !warp.array<1 x f32>, si32
  }
  return
}

// One index is loaded: the loop stays, and memory holds the value.
// CHECK-LABEL: func.func @loaded
// CHECK: warp.scratch
// CHECK: scf.for
func.func @loaded(%a: !warp.array<1 x f32>, %b: !warp.array<1 x si32>) {
  %none = warp.construct() : () -> !warp.vec<12 x f32>
  %c0 = warp.constant 0 : si32
  %i0 = arith.constant 0 : i32
  %i1 = arith.constant 1 : i32
  %i12 = arith.constant 12 : i32
  %v = scf.for %i = %i0 to %i12 step %i1 iter_args(%u = %none)
      -> (!warp.vec<12 x f32>) : i32 {
    %k = warp.cast %i : i32 to si32
    %j = warp.load %b[%k] : !warp.array<1 x si32>, si32 -> si32
    %x = warp.load %a[%k] : !warp.array<1 x f32>, si32 -> f32
    %w = warp.insert %x, %u[%j] : f32, !warp.vec<12 x f32>, si32
    scf.yield %w : !warp.vec<12 x f32>
  }
  %x = warp.extract %v[%c0] : !warp.vec<12 x f32>, si32 -> f32
  warp.store %x, %a[%c0] : f32, !warp.array<1 x f32>, si32
  return
}

// So many iterations of two loops that memory is the better place.
// CHECK-LABEL: func.func @long
// CHECK: warp.scratch
// CHECK: scf.for
func.func @long(%a: !warp.array<1 x f32>) {
  %none = warp.construct() : () -> !warp.vec<12 x f32>
  %c0 = warp.constant 0 : si32
  %c12 = warp.constant 12 : si32
  %i0 = arith.constant 0 : i32
  %i1 = arith.constant 1 : i32
  %i9999 = arith.constant 9999 : i32
  %v = scf.for %i = %i0 to %i9999 step %i1 iter_args(%u = %none)
      -> (!warp.vec<12 x f32>) : i32 {
    %k = warp.cast %i : i32 to si32
    %j = warp.mod(%k, %c12) : (si32, si32) -> si32
    %x = warp.load %a[%k] : !warp.array<1 x f32>, si32 -> f32
    %w = warp.insert %x, %u[%j] : f32, !warp.vec<12 x f32>, si32
    scf.yield %w : !warp.vec<12 x f32>
  }
  %x = warp.extract %v[%c0] : !warp.vec<12 x f32>, si32 -> f32
  warp.store %x, %a[%c0] : f32, !warp.array<1 x f32>, si32
  return
}

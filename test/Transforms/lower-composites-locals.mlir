// RUN: warp-opt --warp-lower-composites %s | FileCheck %s

// A composite of many numbers that a loop indexes lies in memory: one store
// and one load an iteration, nothing carried but a constant.
// CHECK-LABEL: func.func @carried
// CHECK: %[[memory:.*]] = warp.scratch : !warp.scratch<32 x f32>
// CHECK: scf.for
// CHECK: warp.scratch_store %{{.*}}, %[[memory]]
// CHECK: scf.for
// CHECK: arith.minui
// CHECK: warp.scratch_load %[[memory]]
// CHECK: arith.minui
// CHECK: warp.scratch_store %{{.*}}, %[[memory]]
// CHECK-NOT: warp.scratch_
// CHECK: scf.yield %false : i1
// CHECK: warp.scratch_load %[[memory]]
func.func @carried(%n: i32, %at: si32, %x: f32) -> f32 {
  %zero = warp.construct() : () -> !warp.vec<32 x f32>
  %begin = arith.constant 0 : i32
  %step = arith.constant 1 : i32
  %all = scf.for %k = %begin to %n step %step
      iter_args(%v = %zero) -> (!warp.vec<32 x f32>) : i32 {
    %i = warp.cast %k : i32 to si32
    %old = warp.extract %v[%at] : !warp.vec<32 x f32>, si32 -> f32
    %sum = warp.add(%old, %x) : (f32, f32) -> f32
    %w = warp.insert %sum, %v[%i] : f32, !warp.vec<32 x f32>, si32
    scf.yield %w : !warp.vec<32 x f32>
  }
  %y = warp.extract %all[%at] : !warp.vec<32 x f32>, si32 -> f32
  return %y : f32
}

// A value that is used after it was changed has a memory of its own.
// CHECK-LABEL: func.func @copied
// CHECK-COUNT-2: warp.scratch : !warp.scratch<16 x f32>
func.func @copied(%at: si32, %to: si32, %x: f32) -> f32 {
  %zero = warp.construct() : () -> !warp.vec<16 x f32>
  %v = warp.insert %x, %zero[%at] : f32, !warp.vec<16 x f32>, si32
  %w = warp.insert %x, %v[%to] : f32, !warp.vec<16 x f32>, si32
  %a = warp.extract %v[%to] : !warp.vec<16 x f32>, si32 -> f32
  %b = warp.extract %w[%at] : !warp.vec<16 x f32>, si32 -> f32
  %y = warp.add(%a, %b) : (f32, f32) -> f32
  return %y : f32
}

// Branches change one memory.
// CHECK-LABEL: func.func @branches
// CHECK-COUNT-1: warp.scratch : !warp.scratch<16 x f32>
// CHECK-NOT: warp.scratch :
// CHECK: return
func.func @branches(%c: i1, %at: si32, %x: f32) -> f32 {
  %zero = warp.construct() : () -> !warp.vec<16 x f32>
  %v = warp.insert %x, %zero[%at] : f32, !warp.vec<16 x f32>, si32
  %w = scf.if %c -> (!warp.vec<16 x f32>) {
    %y = warp.add(%x, %x) : (f32, f32) -> f32
    %z = warp.insert %y, %v[%at] : f32, !warp.vec<16 x f32>, si32
    scf.yield %z : !warp.vec<16 x f32>
  } else {
    scf.yield %v : !warp.vec<16 x f32>
  }
  %y = warp.extract %w[%at] : !warp.vec<16 x f32>, si32 -> f32
  return %y : f32
}

// Two variables that change places would need a third memory: they stay.
// CHECK-LABEL: func.func @swapped
// CHECK-NOT: warp.scratch_store
// CHECK: return
func.func @swapped(%n: i32, %at: si32, %x: f32) -> f32 {
  %zero = warp.construct() : () -> !warp.vec<16 x f32>
  %v = warp.insert %x, %zero[%at] : f32, !warp.vec<16 x f32>, si32
  %begin = arith.constant 0 : i32
  %step = arith.constant 1 : i32
  %all:2 = scf.for %k = %begin to %n step %step
      iter_args(%a = %v, %b = %zero)
      -> (!warp.vec<16 x f32>, !warp.vec<16 x f32>) : i32 {
    scf.yield %b, %a : !warp.vec<16 x f32>, !warp.vec<16 x f32>
  }
  %c0 = warp.constant 0 : si32
  %y = warp.extract %all#0[%c0] : !warp.vec<16 x f32>, si32 -> f32
  return %y : f32
}

// Adding one number to a component touches no other.
// CHECK-LABEL: func.func @summed
// CHECK: scf.for
// CHECK: scf.for
// CHECK: %[[old:.*]] = warp.scratch_load
// CHECK: %[[sum:.*]] = arith.addf %[[old]], %{{.*}}
// CHECK: warp.scratch_store %[[sum]]
// CHECK-NOT: arith.addf
// CHECK: return
func.func @summed(%n: i32, %at: si32, %x: f32) -> f32 {
  %zero = warp.construct() : () -> !warp.vec<16 x f32>
  %begin = arith.constant 0 : i32
  %step = arith.constant 1 : i32
  %all = scf.for %k = %begin to %n step %step
      iter_args(%v = %zero) -> (!warp.vec<16 x f32>) : i32 {
    %i = warp.cast %k : i32 to si32
    %one = warp.insert %x, %zero[%i] : f32, !warp.vec<16 x f32>, si32
    %w = warp.add(%v, %one) : (!warp.vec<16 x f32>, !warp.vec<16 x f32>)
        -> !warp.vec<16 x f32>
    scf.yield %w : !warp.vec<16 x f32>
  }
  %y = warp.extract %all[%at] : !warp.vec<16 x f32>, si32 -> f32
  return %y : f32
}

// Nor does adding the sum of two.
// CHECK-LABEL: func.func @summed_twice
// CHECK-COUNT-1: warp.scratch : !warp.scratch<16 x f32>
// CHECK-NOT: warp.scratch :
// CHECK-COUNT-2: arith.addf
// CHECK-NOT: arith.addf
// CHECK: return
func.func @summed_twice(%at: si32, %to: si32, %x: f32) -> f32 {
  %zero = warp.construct() : () -> !warp.vec<16 x f32>
  %v = warp.insert %x, %zero[%at] : f32, !warp.vec<16 x f32>, si32
  %one = warp.insert %x, %zero[%at] : f32, !warp.vec<16 x f32>, si32
  %two = warp.insert %x, %zero[%to] : f32, !warp.vec<16 x f32>, si32
  %both = warp.add(%one, %two)
      : (!warp.vec<16 x f32>, !warp.vec<16 x f32>) -> !warp.vec<16 x f32>
  %w = warp.add(%v, %both)
      : (!warp.vec<16 x f32>, !warp.vec<16 x f32>) -> !warp.vec<16 x f32>
  %y = warp.extract %w[%to] : !warp.vec<16 x f32>, si32 -> f32
  return %y : f32
}

// The values that an adjoint keeps lie in one piece, of which one component is
// loaded.
// CHECK-LABEL: func.func @kept
// CHECK: warp.scratch : !warp.scratch<128 x f32>
// CHECK: scf.for
// CHECK: warp.scratch_store
// CHECK: warp.scratch_load
// CHECK-NOT: warp.scratch_load
// CHECK: return
func.func @kept(%slot: i32, %at: si32) -> f32 {
  %zero = warp.construct() : () -> !warp.vec<16 x f32>
  %all = warp.scratch : !warp.scratch<8 x !warp.vec<16 x f32>>
  warp.scratch_store %zero, %all[%slot]
      : !warp.vec<16 x f32>, !warp.scratch<8 x !warp.vec<16 x f32>>, i32
  %v = warp.scratch_load %all[%slot]
      : !warp.scratch<8 x !warp.vec<16 x f32>>, i32 -> !warp.vec<16 x f32>
  %y = warp.extract %v[%at] : !warp.vec<16 x f32>, si32 -> f32
  return %y : f32
}

// Few numbers stay in registers.
// CHECK-LABEL: func.func @few
// CHECK-NOT: warp.scratch
// CHECK: return
func.func @few(%at: si32, %x: f32) -> !warp.vec<4 x f32> {
  %zero = warp.construct() : () -> !warp.vec<4 x f32>
  %v = warp.insert %x, %zero[%at] : f32, !warp.vec<4 x f32>, si32
  return %v : !warp.vec<4 x f32>
}

// A component that an insertion leaves alone is read from the memory that it
// changes, though the value is older: a chain has one memory, in a branch, too.
// CHECK-LABEL: func.func @older
// CHECK-COUNT-1: warp.scratch : !warp.scratch<16 x f32>
// CHECK-NOT: warp.scratch :
// CHECK: return
func.func @older(%c: i1, %at: si32, %x: f32) -> f32 {
  %zero = warp.construct() : () -> !warp.vec<16 x f32>
  %c0 = warp.constant 0 : si32
  %c1 = warp.constant 1 : si32
  %c2 = warp.constant -1 : si32
  %v = warp.insert %x, %zero[%at] : f32, !warp.vec<16 x f32>, si32
  %w = scf.if %c -> (!warp.vec<16 x f32>) {
    %a = warp.insert %x, %v[%c0] : f32, !warp.vec<16 x f32>, si32
    %p = warp.extract %v[%c1] : !warp.vec<16 x f32>, si32 -> f32
    %q = warp.add(%p, %x) : (f32, f32) -> f32
    %b = warp.insert %q, %a[%c1] : f32, !warp.vec<16 x f32>, si32
    %r = warp.extract %v[%c2] : !warp.vec<16 x f32>, si32 -> f32
    %s = warp.add(%r, %x) : (f32, f32) -> f32
    %d = warp.insert %s, %b[%c2] : f32, !warp.vec<16 x f32>, si32
    scf.yield %d : !warp.vec<16 x f32>
  } else {
    scf.yield %v : !warp.vec<16 x f32>
  }
  %y = warp.extract %w[%at] : !warp.vec<16 x f32>, si32 -> f32
  return %y : f32
}

// The old value of a component that has been changed is no other one.
// CHECK-LABEL: func.func @overwritten
// CHECK-COUNT-2: warp.scratch : !warp.scratch<16 x f32>
func.func @overwritten(%at: si32, %x: f32) -> f32 {
  %zero = warp.construct() : () -> !warp.vec<16 x f32>
  %c1 = warp.constant 1 : si32
  %c2 = warp.constant -15 : si32
  %v = warp.insert %x, %zero[%at] : f32, !warp.vec<16 x f32>, si32
  %a = warp.insert %x, %v[%c1] : f32, !warp.vec<16 x f32>, si32
  %p = warp.extract %v[%c2] : !warp.vec<16 x f32>, si32 -> f32
  %q = warp.extract %a[%at] : !warp.vec<16 x f32>, si32 -> f32
  %y = warp.add(%p, %q) : (f32, f32) -> f32
  return %y : f32
}

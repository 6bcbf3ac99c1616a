// RUN: warp-opt %s --warp-differentiate-kernel=active=11 --canonicalize --cse --warp-clean-up-adjoint --split-input-file | FileCheck %s

// The loop writes each element of a row once, from the first to the last. So
// the launch has left what was read from an earlier place, and a copy from
// before it has the rest. The kernel does not run again.
// CHECK-LABEL: func.func @ascending_adjoint
// CHECK-SAME: %[[X:[^ ]*]]: !warp.array<2 x f32>, %{{[^ ]*}}: i32, %{{[^ ]*}}: !warp.array<1 x si32>, %[[COPY:[^ ]*]]: !warp.array<2 x f32>)
// CHECK-SAME: warp.hidden = [#warp.hidden<kind = preserved, leaf = 0>]
// CHECK: %[[K:.*]] = warp.cast {{.*}} : i32 to si32
// CHECK: %[[P:.*]] = warp.load
// CHECK: %[[WRAPPED:.*]] = warp.add(%[[P]],
// CHECK: %[[AT:.*]] = warp.where({{.*}}, %[[WRAPPED]], %[[P]])
// CHECK: %[[EARLIER:.*]] = warp.lt(%[[AT]], %[[K]])
// CHECK: scf.if %[[EARLIER]]
// CHECK: warp.load %[[X]][%{{.*}}, %[[P]]]
// CHECK: else
// CHECK: warp.load %[[COPY]][%{{.*}}, %[[P]]]
// CHECK-NOT: _record
func.func @ascending(%x: !warp.array<2 x f32>, %n: i32, %p: !warp.array<1 x si32>)
    attributes {warp.kernel} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : si32
  scf.for %c = %c0 to %n step %c1 : i32 {
    %k = warp.cast %c : i32 to si32
    %j = warp.load %p[%k] : !warp.array<1 x si32>, si32 -> si32
    %v = warp.load %x[%i, %j] : !warp.array<2 x f32>, si32, si32 -> f32
    %w = warp.sin(%v) : (f32) -> f32
    warp.store %w, %x[%i, %k] : f32, !warp.array<2 x f32>, si32, si32
  }
  return
}

// -----

// From the last one to the first, and what this iteration has written counts
// as written.
// CHECK-LABEL: func.func @descending_adjoint
// CHECK: warp.ge
func.func @descending(%x: !warp.array<2 x f32>, %y: !warp.array<2 x f32>, %n: si32,
                      %p: !warp.array<1 x si32>) attributes {warp.kernel} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : si32
  %count = warp.cast %n : si32 to i32
  scf.for %c = %c0 to %count step %c1 : i32 {
    %k = warp.cast %c : i32 to si32
    %l = warp.sub(%n, %k) : (si32, si32) -> si32
    %u = warp.load %y[%i, %l] : !warp.array<2 x f32>, si32, si32 -> f32
    warp.store %u, %x[%i, %l] : f32, !warp.array<2 x f32>, si32, si32
    %j = warp.load %p[%k] : !warp.array<1 x si32>, si32 -> si32
    %v = warp.load %x[%i, %j] : !warp.array<2 x f32>, si32, si32 -> f32
    %w = warp.sin(%v) : (f32) -> f32
    warp.store %w, %y[%i, %l] : f32, !warp.array<2 x f32>, si32, si32
  }
  return
}

// -----

// Two loops write the same elements: what was read may be gone.
// CHECK-LABEL: func.func @twice_adjoint
// CHECK-SAME: kind = tape
// CHECK-LABEL: func.func @twice_record
func.func @twice(%x: !warp.array<2 x f32>, %n: i32, %p: !warp.array<1 x si32>)
    attributes {warp.kernel} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : si32
  scf.for %again = %c0 to %n step %c1 : i32 {
    scf.for %c = %c0 to %n step %c1 : i32 {
      %k = warp.cast %c : i32 to si32
      %j = warp.load %p[%k] : !warp.array<1 x si32>, si32 -> si32
      %v = warp.load %x[%i, %j] : !warp.array<2 x f32>, si32, si32 -> f32
      %w = warp.sin(%v) : (f32) -> f32
      warp.store %w, %x[%i, %k] : f32, !warp.array<2 x f32>, si32, si32
    }
  }
  return
}

// -----

// Each iteration of the outer loop has a row of its own.
// CHECK-LABEL: func.func @rows_adjoint
// CHECK-SAME: kind = preserved
// CHECK: warp.lt
// CHECK-NOT: _record
func.func @rows(%x: !warp.array<3 x f32>, %n: i32, %p: !warp.array<1 x si32>)
    attributes {warp.kernel} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : si32
  scf.for %a = %c0 to %n step %c1 : i32 {
    %r = warp.cast %a : i32 to si32
    scf.for %c = %c0 to %n step %c1 : i32 {
      %k = warp.cast %c : i32 to si32
      %j = warp.load %p[%k] : !warp.array<1 x si32>, si32 -> si32
      %v = warp.load %x[%i, %r, %j] : !warp.array<3 x f32>, si32, si32, si32 -> f32
      %w = warp.sin(%v) : (f32) -> f32
      warp.store %w, %x[%i, %r, %k] : f32, !warp.array<3 x f32>, si32, si32, si32
    }
  }
  return
}

// -----

// Without a copy from before the launch, each value that is needed asserts that
// the launch had written it. The last store needs none.
// CHECK-LABEL: func.func @unrecorded_adjoint
// CHECK-NOT: warp.hidden
// CHECK: warp.where
// CHECK: %[[EARLIER:.*]] = warp.lt
// CHECK: warp.load %arg0
// CHECK: warp.assert %[[EARLIER]], "the derivative depends on array 'x' as it was before the launch, record the launch on a `wp.Tape`" always
// CHECK-NOT: warp.assert
// CHECK: return
func.func @unrecorded(%x: !warp.array<2 x f32>, %y: !warp.array<2 x f32>, %n: i32,
                      %p: !warp.array<1 x si32>)
    attributes {warp.kernel, warp.unrecorded, warp.arg_names = ["x", "y", "n", "p"]} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : si32
  scf.for %c = %c0 to %n step %c1 : i32 {
    %k = warp.cast %c : i32 to si32
    %j = warp.load %p[%k] : !warp.array<1 x si32>, si32 -> si32
    %v = warp.load %x[%i, %j] : !warp.array<2 x f32>, si32, si32 -> f32
    %w = warp.sin(%v) : (f32) -> f32
    warp.store %w, %x[%i, %k] : f32, !warp.array<2 x f32>, si32, si32
    %l = warp.load %p[%j] : !warp.array<1 x si32>, si32 -> si32
    %u = warp.load %x[%i, %l] : !warp.array<2 x f32>, si32, si32 -> f32
    warp.store %u, %y[%i, %k] : f32, !warp.array<2 x f32>, si32, si32
  }
  return
}

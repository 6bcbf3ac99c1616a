// RUN: warp-opt %s --warp-forward-stores --warp-differentiate-kernel=active=11 --canonicalize --cse --warp-clean-up-adjoint --split-input-file | FileCheck %s

// An earlier iteration may have written the values that a loop reads: they are
// kept by iteration, by a second run of the kernel on a copy of the array.
// Threads leave their number at what they write, because indices do not tell
// whether they meet.
// CHECK-LABEL: func.func @chain_adjoint
// CHECK-SAME: %[[OFFSETS:[^ ]*]]: !warp.array<4 x si64>, %[[TAPE:[^ ]*]]: !warp.array<2 x f32>)
// CHECK-SAME: warp.hidden = [#warp.hidden<kind = offsets, leaf = 0>, #warp.hidden<kind = tape, leaf = 0>]
// CHECK: warp.load %[[OFFSETS]]
// CHECK: scf.for
// CHECK: warp.load %[[TAPE]]
// CHECK-NOT: warp.load %arg0
// What finds out how much there is to keep computes none of it.
// CHECK-LABEL: func.func @chain_size
// CHECK-SAME: #warp.hidden<kind = claims, leaf = 0>
// CHECK-NOT: warp.mul
// CHECK: warp.atomic exch
// CHECK-NOT: warp.mul
// CHECK: return
// CHECK-LABEL: func.func @chain_record
// CHECK-SAME: %[[CLAIMS:[^ ]*]]: !warp.array<1 x si32>, %[[CONFLICTS:[^ ]*]]: !warp.array<1 x si32>, %[[COPY:[^ ]*]]: !warp.array<1 x f32>)
// CHECK-SAME: #warp.hidden<kind = preserved, leaf = 0>
// CHECK: scf.for {{.*}} iter_args
// CHECK: warp.load %[[CLAIMS]]
// CHECK: warp.load %[[COPY]]
// CHECK: warp.atomic exch {{.*}}, %[[CLAIMS]]
// CHECK: warp.store {{.*}}, %[[COPY]]
func.func @chain(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: i32,
                 %p: !warp.array<1 x si32>, %q: !warp.array<1 x si32>)
    attributes {warp.kernel, warp.arg_names = ["x", "y", "n", "p", "q"]} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  scf.for %c = %c0 to %n step %c1 : i32 {
    %k = warp.cast %c : i32 to si32
    %i = warp.load %p[%k] : !warp.array<1 x si32>, si32 -> si32
    %j = warp.load %q[%k] : !warp.array<1 x si32>, si32 -> si32
    %a = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
    %d = warp.load %y[%k] : !warp.array<1 x f32>, si32 -> f32
    %b = warp.mul(%a, %d) : (f32, f32) -> f32
    warp.store %b, %x[%j] : f32, !warp.array<1 x f32>, si32
  }
  return
}

// -----

// Nothing is kept of a loop that is linear in what it reads, and nothing is
// checked where every thread has a row of its own.
// CHECK-LABEL: func.func @linear_adjoint
// CHECK-NOT: warp.hidden
// CHECK-NOT: func.func @linear_record
func.func @linear(%x: !warp.array<2 x f32>, %y: !warp.array<1 x f32>, %n: i32,
                  %p: !warp.array<1 x si32>)
    attributes {warp.kernel, warp.arg_names = ["x", "y", "n", "p"]} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %t = warp.tid : si32
  scf.for %c = %c0 to %n step %c1 : i32 {
    %k = warp.cast %c : i32 to si32
    %i = warp.load %p[%k] : !warp.array<1 x si32>, si32 -> si32
    %a = warp.load %x[%t, %i] : !warp.array<2 x f32>, si32, si32 -> f32
    %b = warp.add(%a, %a) : (f32, f32) -> f32
    warp.store %b, %x[%t, %k] : f32, !warp.array<2 x f32>, si32, si32
  }
  return
}

// -----

// A condition on memory that changes is kept, too: one value more than
// the loop has iterations.
// CHECK-LABEL: func.func @tested_adjoint
// CHECK-SAME: %{{[^ ]*}}: !warp.array<4 x si64>, %[[TAPE:[^ ]*]]: !warp.array<2 x f32>)
// CHECK: scf.while
// CHECK: warp.load %[[TAPE]]
// CHECK: warp.gt
// CHECK-LABEL: func.func @tested_record
// CHECK: scf.while
// CHECK: warp.store
// CHECK: scf.condition
func.func @tested(%x: !warp.array<2 x f32>, %p: !warp.array<1 x si32>)
    attributes {warp.kernel} {
  %half = warp.constant 0.5 : f32
  %i = warp.tid : si32
  scf.while : () -> () {
    %k = warp.load %p[%i] : !warp.array<1 x si32>, si32 -> si32
    %v = warp.load %x[%i, %k] : !warp.array<2 x f32>, si32, si32 -> f32
    %more = warp.gt(%v, %half) : (f32, f32) -> i1
    scf.condition(%more)
  } do {
    %k = warp.load %p[%i] : !warp.array<1 x si32>, si32 -> si32
    %v = warp.load %x[%i, %k] : !warp.array<2 x f32>, si32, si32 -> f32
    %w = warp.mul(%v, %half) : (f32, f32) -> f32
    warp.store %w, %x[%i, %k] : f32, !warp.array<2 x f32>, si32, si32
    scf.yield
  }
  return
}

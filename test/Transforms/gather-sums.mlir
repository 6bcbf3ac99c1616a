// RUN: warp-opt %s --split-input-file --warp-gather-sums --canonicalize --cse | FileCheck %s
// RUN: warp-opt %s --split-input-file --warp-gather-sums | FileCheck %s --check-prefix=RAW

// Each sum is computed for the thread that would have sent it, if there is one.
// The launch is larger by the largest offset.
// CHECK-LABEL: func.func @line_sums
// CHECK-SAME: %[[X:.*]]: !warp.array<1 x f32>, %[[Y:.*]]: !warp.array<1 x f32>, %[[N:.*]]: si32)
// CHECK-SAME: warp.arg_names = ["x", "y", "launch.0"]
// CHECK-SAME: warp.halo = array<i64: 1>
// CHECK-DAG: %[[ONE:.*]] = warp.constant 1 : si32
// CHECK-DAG: %[[TWO:.*]] = warp.constant 2 : si32
// CHECK-DAG: %[[I:.*]] = warp.tid : si32
// CHECK-DAG: %[[BEFORE:.*]] = warp.sub(%[[I]], %[[ONE]])
// CHECK-DAG: %[[AFTER:.*]] = warp.add(%[[I]], %[[ONE]])
// CHECK: %[[END:.*]] = warp.add(%[[N]], %{{.*}})
// CHECK: %[[IN:.*]] = warp.lt(%[[I]], %[[END]])
// CHECK: scf.if %[[IN]] -> (f32) {
// CHECK: warp.load %{{.*}}[%[[AFTER]]]
// CHECK: %[[FROM:.*]] = warp.ge(%[[I]], %[[ONE]])
// CHECK: %[[TO:.*]] = warp.lt(%[[I]], %[[N]])
// CHECK: %[[IN:.*]] = warp.bit_and(%[[FROM]], %[[TO]])
// CHECK: scf.if %[[IN]] -> (f32) {
// CHECK: %[[V:.*]] = warp.load %{{.*}}[%[[I]]]
// CHECK: warp.neg(%[[V]])
// CHECK: %[[IN:.*]] = warp.ge(%[[I]], %[[TWO]])
// CHECK: scf.if %[[IN]] -> (f32) {
// CHECK: warp.load %{{.*}}[%[[BEFORE]]]
// CHECK: %[[GX:.*]] = warp.grad %[[X]]
// CHECK: warp.accumulate %{{.*}}, %[[GX]][%[[I]]] {unique = 1 : i64}
// CHECK-NOT: warp.store
// CHECK-NOT: warp.accumulate
// CHECK-LABEL: func.func @line
// CHECK-SAME: warp.kernel
// CHECK-NOT: warp.load
// CHECK: warp.store
// CHECK-NOT: warp.accumulate

// RAW-LABEL: func.func @line_sums
// RAW-COUNT-3: warp.load
// RAW: warp.accumulate
// RAW-LABEL: func.func @line
// RAW-NOT: warp.accumulate
func.func @line(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.arg_names = ["x", "y"]} {
  %zero = warp.constant 0.0 : f32
  %one = warp.constant 1 : si32
  %i = warp.tid : si32
  %gx = warp.grad %x : !warp.array<1 x f32> -> !warp.array<1 x f32>
  %gy = warp.grad %y : !warp.array<1 x f32> -> !warp.array<1 x f32>
  %inside = warp.ge(%i, %one) : (si32, si32) -> i1
  scf.if %inside {
    %v = warp.load %gy[%i] : !warp.array<1 x f32>, si32 -> f32
    warp.store %zero, %gy[%i] : f32, !warp.array<1 x f32>, si32
    %before = warp.sub(%i, %one) : (si32, si32) -> si32
    %after = warp.add(%one, %i) : (si32, si32) -> si32
    %w = warp.neg(%v) : (f32) -> f32
    warp.accumulate %v, %gx[%before] : f32, !warp.array<1 x f32>, si32
    warp.accumulate %w, %gx[%i] : f32, !warp.array<1 x f32>, si32
    warp.accumulate %v, %gx[%after] : f32, !warp.array<1 x f32>, si32
  }
  return
}

// -----

// A negative index counts from the end: nothing says that it is none.
// CHECK-LABEL: func.func @wrapped
// CHECK-NOT: warp.halo
// CHECK-COUNT-2: warp.accumulate
// RAW-LABEL: func.func @wrapped
// RAW-NOT: warp.halo
func.func @wrapped(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %one = warp.constant 1 : si32
  %i = warp.tid : si32
  %before = warp.sub(%i, %one) : (si32, si32) -> si32
  %gx = warp.grad %x : !warp.array<1 x f32> -> !warp.array<1 x f32>
  %v = warp.load %y[%i] : !warp.array<1 x f32>, si32 -> f32
  warp.accumulate %v, %gx[%i] : f32, !warp.array<1 x f32>, si32
  warp.accumulate %v, %gx[%before] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// A read after a write does not give the value before the launch.
// CHECK-LABEL: func.func @late
// CHECK-NOT: warp.halo
// RAW-LABEL: func.func @late
// RAW-NOT: warp.halo
func.func @late(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %v: f32)
    attributes {warp.kernel} {
  %one = warp.constant 1 : si32
  %i = warp.tid : si32
  %after = warp.add(%i, %one) : (si32, si32) -> si32
  %gx = warp.grad %x : !warp.array<1 x f32> -> !warp.array<1 x f32>
  %gy = warp.grad %y : !warp.array<1 x f32> -> !warp.array<1 x f32>
  warp.store %v, %gy[%i] : f32, !warp.array<1 x f32>, si32
  %w = warp.load %gy[%i] : !warp.array<1 x f32>, si32 -> f32
  warp.accumulate %w, %gx[%i] : f32, !warp.array<1 x f32>, si32
  warp.accumulate %w, %gx[%after] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// A write on the other side of a branch does not come before.
// CHECK-LABEL: func.func @sides_sums
// CHECK-LABEL: func.func @sides
// CHECK-NOT: warp.accumulate
// RAW-LABEL: func.func @sides_sums
func.func @sides(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %c: i1)
    attributes {warp.kernel} {
  %zero = warp.constant 0.0 : f32
  %one = warp.constant 1 : si32
  %i = warp.tid : si32
  %after = warp.add(%i, %one) : (si32, si32) -> si32
  %gx = warp.grad %x : !warp.array<1 x f32> -> !warp.array<1 x f32>
  %gy = warp.grad %y : !warp.array<1 x f32> -> !warp.array<1 x f32>
  scf.if %c {
    %v = warp.load %gy[%i] : !warp.array<1 x f32>, si32 -> f32
    warp.store %zero, %gy[%i] : f32, !warp.array<1 x f32>, si32
    warp.accumulate %v, %gx[%after] : f32, !warp.array<1 x f32>, si32
  } else {
    %v = warp.load %gy[%i] : !warp.array<1 x f32>, si32 -> f32
    warp.store %zero, %gy[%i] : f32, !warp.array<1 x f32>, si32
    warp.accumulate %v, %gx[%i] : f32, !warp.array<1 x f32>, si32
  }
  return
}

// -----

// Loads that only some threads may do stay behind the branches before them;
// conditions without loads are computed first, so that one branch is left.
// CHECK-LABEL: func.func @guards_sums
// CHECK-SAME: %[[X:.*]]: !warp.array<1 x f32>, %{{.*}}: !warp.array<1 x f32>, %[[N:.*]]: si32, %[[EXTENT:.*]]: si32)
// CHECK: %[[I:.*]] = warp.tid
// CHECK: %[[M:.*]] = warp.max(%[[N]]
// CHECK: %[[LIMIT:.*]] = warp.min(%[[M]]
// CHECK: %[[END:.*]] = warp.min(%[[LIMIT]], %[[EXTENT]])
// CHECK: %[[IN:.*]] = warp.lt(%[[I]], %[[END]])
// CHECK: scf.if %[[IN]] -> (f32, i1) {
// CHECK: %[[V:.*]] = warp.load %[[X]]
// CHECK: %[[POSITIVE:.*]] = warp.gt(%[[V]]
// CHECK: scf.if %[[POSITIVE]] -> (f32) {
// CHECK: warp.load
func.func @guards(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: si32)
    attributes {warp.kernel} {
  %zero = warp.constant 0.0 : f32
  %one = warp.constant 1 : si32
  %i = warp.tid : si32
  %after = warp.add(%i, %one) : (si32, si32) -> si32
  %gx = warp.grad %x : !warp.array<1 x f32> -> !warp.array<1 x f32>
  %gy = warp.grad %y : !warp.array<1 x f32> -> !warp.array<1 x f32>
  %inside = warp.lt(%i, %n) : (si32, si32) -> i1
  scf.if %inside {
    %v = warp.load %x[%after] : !warp.array<1 x f32>, si32 -> f32
    %positive = warp.gt(%v, %zero) : (f32, f32) -> i1
    scf.if %positive {
      %g = warp.load %gy[%i] : !warp.array<1 x f32>, si32 -> f32
      warp.accumulate %g, %gx[%after] : f32, !warp.array<1 x f32>, si32
      warp.accumulate %g, %gx[%i] : f32, !warp.array<1 x f32>, si32
    }
  }
  return
}

// -----

// Short loops over neighbours are unrolled.
// CHECK-LABEL: func.func @loop_sums
// CHECK-SAME: warp.halo = array<i64: 2>
// CHECK-LABEL: func.func @loop
// CHECK-NOT: warp.accumulate
func.func @loop(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %c3 = arith.constant 3 : i32
  %i = warp.tid : si32
  %gx = warp.grad %x : !warp.array<1 x f32> -> !warp.array<1 x f32>
  %gy = warp.grad %y : !warp.array<1 x f32> -> !warp.array<1 x f32>
  %v = warp.load %gy[%i] : !warp.array<1 x f32>, si32 -> f32
  scf.for %k = %c0 to %c3 step %c1 : i32 {
    %d = warp.cast %k : i32 to si32
    %j = warp.add(%i, %d) : (si32, si32) -> si32
    warp.accumulate %v, %gx[%j] : f32, !warp.array<1 x f32>, si32
  }
  return
}

// -----

// Dimensions of the array may come in another order than those of the launch,
// but in the same one for all sums.
// CHECK-LABEL: func.func @transposed_sums
// CHECK-SAME: warp.halo = array<i64: 1, 2>
// CHECK: %[[T:.*]]:2 = warp.tid
// CHECK: warp.accumulate %{{.*}}, %{{.*}}[%[[T]]#1, %[[T]]#0] {unique = 2 : i64}
func.func @transposed(%x: !warp.array<2 x f32>, %v: f32)
    attributes {warp.kernel} {
  %one = warp.constant 1 : si32
  %two = warp.constant 2 : si32
  %i, %j = warp.tid : si32, si32
  %below = warp.add(%i, %one) : (si32, si32) -> si32
  %right = warp.add(%j, %two) : (si32, si32) -> si32
  %gx = warp.grad %x : !warp.array<2 x f32> -> !warp.array<2 x f32>
  warp.accumulate %v, %gx[%right, %i] : f32, !warp.array<2 x f32>, si32, si32
  warp.accumulate %v, %gx[%j, %below] : f32, !warp.array<2 x f32>, si32, si32
  return
}

// -----

// CHECK-LABEL: func.func @mixed
// CHECK-NOT: warp.halo
func.func @mixed(%x: !warp.array<2 x f32>, %v: f32)
    attributes {warp.kernel} {
  %i, %j = warp.tid : si32, si32
  %gx = warp.grad %x : !warp.array<2 x f32> -> !warp.array<2 x f32>
  warp.accumulate %v, %gx[%i, %j] : f32, !warp.array<2 x f32>, si32, si32
  warp.accumulate %v, %gx[%j, %i] : f32, !warp.array<2 x f32>, si32, si32
  return
}

// -----

// An index that is the same in all threads, such as that of a channel, stays;
// gradients of each are gathered apart. Threads inside of the launch have one
// branch for terms at the same distance in the last dimension.
// CHECK-LABEL: func.func @channels_sums
// CHECK-SAME: warp.halo = array<i64: 1, 1>
// CHECK: %[[T:.*]]:2 = warp.tid
// CHECK: scf.if %{{.*}} {
// CHECK: warp.accumulate %{{.*}}, %{{.*}}[%{{.*}}, %[[T]]#0, %[[T]]#1] {unique = 2 : i64}
// CHECK: warp.accumulate %{{.*}}, %{{.*}}[%{{.*}}, %[[T]]#0, %[[T]]#1] {unique = 2 : i64}
// CHECK: } else {
// CHECK: warp.accumulate %{{.*}}, %{{.*}}[%{{.*}}, %[[T]]#0, %[[T]]#1] {unique = 2 : i64}
// CHECK: warp.accumulate %{{.*}}, %{{.*}}[%{{.*}}, %[[T]]#0, %[[T]]#1] {unique = 2 : i64}
// CHECK-LABEL: func.func @channels
// CHECK-NOT: warp.accumulate
func.func @channels(%x: !warp.array<3 x f32>, %y: !warp.array<3 x f32>)
    attributes {warp.kernel} {
  %first = warp.constant 0 : si32
  %one = warp.constant 1 : si32
  %zero = warp.constant 0.0 : f32
  %i, %j = warp.tid : si32, si32
  %below = warp.add(%i, %one) : (si32, si32) -> si32
  %right = warp.add(%j, %one) : (si32, si32) -> si32
  %gx = warp.grad %x : !warp.array<3 x f32> -> !warp.array<3 x f32>
  %gy = warp.grad %y : !warp.array<3 x f32> -> !warp.array<3 x f32>
  %v = warp.load %gy[%first, %i, %j] : !warp.array<3 x f32>, si32, si32, si32 -> f32
  warp.store %zero, %gy[%first, %i, %j] : f32, !warp.array<3 x f32>, si32, si32, si32
  %w = warp.load %gy[%one, %i, %j] : !warp.array<3 x f32>, si32, si32, si32 -> f32
  warp.store %zero, %gy[%one, %i, %j] : f32, !warp.array<3 x f32>, si32, si32, si32
  warp.accumulate %v, %gx[%first, %below, %j] : f32, !warp.array<3 x f32>, si32, si32, si32
  warp.accumulate %w, %gx[%first, %i, %j] : f32, !warp.array<3 x f32>, si32, si32, si32
  warp.accumulate %w, %gx[%one, %i, %right] : f32, !warp.array<3 x f32>, si32, si32, si32
  warp.accumulate %v, %gx[%one, %i, %j] : f32, !warp.array<3 x f32>, si32, si32, si32
  return
}

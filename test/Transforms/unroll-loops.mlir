// RUN: warp-opt %s --split-input-file --warp-form-launch --warp-apply-schedules --warp-emit-entry --warp-unroll-loops --mlir-print-local-scope | FileCheck %s

#gpu = #warp.variant<target = <name = "sm_90">>

// A small loop that loads and adds is marked.
// CHECK-LABEL: llvm.func {{.*}}@counted
// CHECK: scf.for
// CHECK: loop_annotation = #llvm.loop_annotation<unroll = <count = 4 : i32>>
func.func @counted(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %i = warp.tid : i32
  %zero = arith.constant 0.0 : f32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %sum = scf.for %j = %c0 to %n step %c1 iter_args(%s = %zero) -> f32 : i32 {
    %v = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
    %t = arith.addf %s, %v : f32
    scf.yield %t : f32
  }
  warp.store_components(%sum), %y[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">>

// One that calls a function is not, nor is one that stores.
// CHECK-LABEL: llvm.func {{.*}}@heavy
// CHECK-NOT: loop_annotation
func.func @heavy(%x: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %i = warp.tid : i32
  %one = arith.constant 1.0 : f32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %r = scf.for %j = %c0 to %n step %c1 iter_args(%s = %one) -> f32 : i32 {
    %p = math.sin %s : f32
    %q = math.cos %p : f32
    scf.yield %q : f32
  }
  scf.for %j = %c0 to %n step %c1 : i32 {
    warp.store_components(%r), %x[%j] : (f32), !warp.array<1 x f32>, i32
  }
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">>

// A known number of iterations that wait for memory: each gets a copy, or as
// many as divide the number, here 25 of 100 with two loads each. Iterations
// without loads are left to LLVM.
// CHECK-LABEL: llvm.func {{.*}}@known
// CHECK: loop_annotation = #llvm.loop_annotation<unroll = <count = 27 : i32>>
// CHECK: loop_annotation = #llvm.loop_annotation<unroll = <count = 25 : i32>>
// CHECK-NOT: loop_annotation
func.func @known(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #gpu} {
  %i = warp.tid : i32
  %zero = arith.constant 0.0 : f32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %c27 = arith.constant 27 : i32
  %c100 = arith.constant 100 : i32
  %sum = scf.for %j = %c0 to %c27 step %c1 iter_args(%s = %zero) -> f32 : i32 {
    %v = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
    %t = arith.addf %s, %v : f32
    scf.yield %t : f32
  }
  %more = scf.for %j = %c0 to %c100 step %c1 iter_args(%s = %sum) -> f32 : i32 {
    %v = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
    %w = warp.load_components %y[%j] : !warp.array<1 x f32>, i32 -> f32
    %vw = arith.mulf %v, %w : f32
    %t = arith.addf %s, %vw : f32
    scf.yield %t : f32
  }
  %last = scf.for %j = %c0 to %c27 step %c1 iter_args(%s = %more) -> f32 : i32 {
    %t = arith.mulf %s, %s : f32
    scf.yield %t : f32
  }
  warp.store_components(%last), %y[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">>

// Four iterations run ahead. The counter is asked once, with a limit that
// cannot overflow; the square four times.
// CHECK-LABEL: llvm.func {{.*}}@conditional
// CHECK-DAG: %[[LEAST:.*]] = arith.constant -2147483645 : i32
// CHECK-DAG: %[[N:.*]] = warp.parameter %{{.*}}[80]
// CHECK: %[[CLAMPED:.*]] = arith.maxsi %[[N]], %[[LEAST]]
// CHECK: %[[LIMIT:.*]] = arith.subi %[[CLAMPED]], %{{.*}}
// CHECK: %[[AHEAD:.*]]:4 = scf.while (%[[K:.*]] = %{{.*}}, %[[Z:.*]] = %{{.*}})
// CHECK: arith.cmpi slt, %[[K]], %[[LIMIT]]
// CHECK-COUNT-4: arith.cmpf olt
// CHECK-NOT: arith.cmpf
// CHECK: scf.condition(%{{.*}}) %[[K]], %[[Z]], %[[K4:.*]], %[[Z4:.*]] :
// CHECK: ^bb0(%{{.*}}: i32, %{{.*}}: f32, %[[NEXT_K:.*]]: i32, %[[NEXT_Z:.*]]: f32):
// CHECK-NEXT: scf.yield %[[NEXT_K]], %[[NEXT_Z]]
// CHECK: scf.while (%{{.*}} = %[[AHEAD]]#0, %{{.*}} = %[[AHEAD]]#1)
// CHECK: arith.cmpi slt, %{{.*}}, %[[N]]
func.func @conditional(%y: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %i = warp.tid : i32
  %zero = arith.constant 0.0 : f32
  %four = arith.constant 4.0 : f32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %r:2 = scf.while (%k = %c0, %z = %zero) : (i32, f32) -> (i32, f32) {
    %more = arith.cmpi slt, %k, %n : i32
    %square = arith.mulf %z, %z : f32
    %inside = arith.cmpf olt, %square, %four : f32
    %both = arith.andi %more, %inside : i1
    scf.condition(%both) %k, %z : i32, f32
  } do {
  ^bb0(%k: i32, %z: f32):
    %t = arith.addf %z, %four : f32
    %l = arith.addi %k, %c1 : i32
    scf.yield %l, %t : i32, f32
  }
  warp.store_components(%r#1), %y[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">>

// Loads that may not run ahead: the element need not exist. A loop in a loop
// would run iterations twice each time.
// CHECK-LABEL: llvm.func {{.*}}@unsuited
// CHECK-COUNT-2: scf.while
// CHECK-NOT: scf.while
func.func @unsuited(%x: !warp.array<1 x si32>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %r = scf.while (%k = %i) : (i32) -> i32 {
    %more = arith.cmpi slt, %k, %n : i32
    scf.condition(%more) %k : i32
  } do {
  ^bb0(%k: i32):
    %next = warp.load_components %x[%k] : !warp.array<1 x si32>, i32 -> i32
    scf.yield %next : i32
  }
  scf.for %j = %c0 to %n step %c1 : i32 {
    %q = scf.while (%k = %r) : (i32) -> i32 {
      %more = arith.cmpi slt, %k, %n : i32
      scf.condition(%more) %k : i32
    } do {
    ^bb0(%k: i32):
      %next = arith.addi %k, %k : i32
      scf.yield %next : i32
    }
    warp.store_components(%q), %x[%j] : (i32), !warp.array<1 x si32>, i32
  }
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>>

// The CPU has lanes instead.
// CHECK-LABEL: llvm.func @cpu
// CHECK-NOT: loop_annotation = #llvm.loop_annotation<unroll = <count
func.func @cpu(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %zero = arith.constant 0.0 : f32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %sum = scf.for %j = %c0 to %n step %c1 iter_args(%s = %zero) -> f32 : i32 {
    %v = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
    %t = arith.addf %s, %v : f32
    scf.yield %t : f32
  }
  warp.store_components(%sum), %y[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// RUN: warp-opt %s --split-input-file --warp-form-launch --warp-widen-threads | FileCheck %s

#cpu = #warp.variant<target = <name = "cpu", bits = 512>, packed = 3>

// A thread's own memory has a vector in each slot: loops over it are worth
// lanes, if all of them use the same slot.
// CHECK-LABEL: func.func @turned
// CHECK: lanes =
// CHECK: warp.scratch : !warp.scratch<16 x vector<
func.func @turned(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %zero = arith.constant 0 : i32
  %one = arith.constant 1 : i32
  %last = arith.constant 15 : i32
  %count = arith.constant 16 : i32
  %start = arith.constant 1.0 : f32
  %memory = warp.scratch : !warp.scratch<16 x f32>
  %a = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %power = scf.for %k = %zero to %count step %one iter_args(%p = %start)
      -> (f32) : i32 {
    warp.scratch_store %p, %memory[%k] : f32, !warp.scratch<16 x f32>, i32
    %next = arith.mulf %p, %a : f32
    scf.yield %next : f32
  }
  %sum = scf.for %k = %zero to %count step %one iter_args(%s = %power)
      -> (f32) : i32 {
    %at = arith.subi %last, %k : i32
    %p = warp.scratch_load %memory[%at] : !warp.scratch<16 x f32>, i32 -> f32
    %more = arith.addf %s, %p : f32
    scf.yield %more : f32
  }
  warp.store_components (%sum), %y[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 512>, packed = 7>

// Six neighbours by a list are gathered: a loop that is unrolled, in which a
// processor has several threads in hand.
// CHECK-LABEL: func.func @neighbours
// CHECK-NOT: lanes =
// CHECK-LABEL: func.func @edges
func.func @neighbours(%x: !warp.array<1 x f32>, %near: !warp.array<2 x si32>,
                      %y: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %zero = arith.constant 0 : i32
  %one = arith.constant 1 : i32
  %six = arith.constant 6 : i32
  %none = arith.constant 0.0 : f32
  %total = scf.for %k = %zero to %six step %one iter_args(%s = %none)
      -> (f32) : i32 {
    %j = warp.load_components %near[%i, %k]
      : !warp.array<2 x si32>, i32, i32 -> i32
    %v = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
    %w = arith.mulf %v, %v : f32
    %next = arith.addf %s, %w : f32
    scf.yield %next : f32
  }
  warp.store_components (%total), %y[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 512>, packed = 15>

// The edges of a node of a graph: the gathers take as long as for the node that
// has most. With more to compute for each lanes are worth it.
// CHECK-NOT: lanes =
// CHECK-LABEL: func.func @far_edges
// CHECK: lanes =
func.func @edges(%starts: !warp.array<1 x si32>, %ends: !warp.array<1 x si32>,
                 %x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %one = arith.constant 1 : i32
  %none = arith.constant 0.0 : f32
  %j = arith.addi %i, %one : i32
  %from = warp.load_components %starts[%i] : !warp.array<1 x si32>, i32 -> i32
  %to = warp.load_components %starts[%j] : !warp.array<1 x si32>, i32 -> i32
  %total = scf.for %k = %from to %to step %one iter_args(%s = %none)
      -> (f32) : i32 {
    %e = warp.load_components %ends[%k] : !warp.array<1 x si32>, i32 -> i32
    %v = warp.load_components %x[%e] : !warp.array<1 x f32>, i32 -> f32
    %w = arith.mulf %v, %v : f32
    %u = arith.addf %w, %v : f32
    %next = arith.addf %s, %u : f32
    scf.yield %next : f32
  }
  warp.store_components (%total), %y[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 512>, packed = 15>

func.func @far_edges(%starts: !warp.array<1 x si32>,
                     %ends: !warp.array<1 x si32>, %x: !warp.array<1 x f32>,
                     %y: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %one = arith.constant 1 : i32
  %none = arith.constant 0.0 : f32
  %j = arith.addi %i, %one : i32
  %from = warp.load_components %starts[%i] : !warp.array<1 x si32>, i32 -> i32
  %to = warp.load_components %starts[%j] : !warp.array<1 x si32>, i32 -> i32
  %total = scf.for %k = %from to %to step %one iter_args(%s = %none)
      -> (f32) : i32 {
    %e = warp.load_components %ends[%k] : !warp.array<1 x si32>, i32 -> i32
    %v = warp.load_components %x[%e] : !warp.array<1 x f32>, i32 -> f32
    %w = math.exp %v : f32
    %next = arith.addf %s, %w : f32
    scf.yield %next : f32
  }
  warp.store_components (%total), %y[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// RUN: warp-opt %s --warp-form-launch --warp-widen-threads | FileCheck %s

#cpu = #warp.variant<target = <platform = cpu, bits = 512>, contiguous = 3>

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

// RUN: warp-opt %s --split-input-file --warp-differentiate-kernel='active=11 dump-recovery' -verify-diagnostics

// With dump-recovery, every carried value that is needed says how it is had
// again: its rank, and the bytes that this takes.
func.func @kept(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %one = warp.constant 1.0 : f32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %c8 = arith.constant 8 : i32
  %i = warp.tid : si32
  // expected-remark@+1 {{carried value 0 of type 'f32': rank 5, 32 bytes}}
  %s = scf.for %k = %c0 to %c8 step %c1 iter_args(%t = %one) -> f32 : i32 {
    %v = warp.load %x[%k] : !warp.array<1 x f32>, i32 -> f32
    %u = warp.mul(%t, %v) : (f32, f32) -> f32
    scf.yield %u : f32
  }
  warp.store %s, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// More than 256 bytes, but no more than the 844 of checkpoints.
func.func @long(%x: !warp.array<1 x f64>, %y: !warp.array<1 x f64>)
    attributes {warp.kernel} {
  %one = warp.constant 1.0 : f64
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %n = arith.constant 105 : i32
  %i = warp.tid : si32
  // expected-remark@+1 {{carried value 0 of type 'f64': rank 5, 840 bytes}}
  %s = scf.for %k = %c0 to %n step %c1 iter_args(%t = %one) -> (f64) : i32 {
    %j = warp.cast %k : i32 to si32
    %v = warp.load %x[%j] : !warp.array<1 x f64>, si32 -> f64
    %u = warp.sin(%t) : (f64) -> f64
    %w = warp.add(%u, %v) : (f64, f64) -> f64
    scf.yield %w : f64
  }
  warp.store %s, %y[%i] : f64, !warp.array<1 x f64>, si32
  return
}

// -----

func.func @longer(%x: !warp.array<1 x f64>, %y: !warp.array<1 x f64>)
    attributes {warp.kernel} {
  %one = warp.constant 1.0 : f64
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %n = arith.constant 106 : i32
  %i = warp.tid : si32
  // expected-remark@+1 {{carried value 0 of type 'f64': rank 6, 648 bytes}}
  %s = scf.for %k = %c0 to %n step %c1 iter_args(%t = %one) -> (f64) : i32 {
    %j = warp.cast %k : i32 to si32
    %v = warp.load %x[%j] : !warp.array<1 x f64>, si32 -> f64
    %u = warp.sin(%t) : (f64) -> f64
    %w = warp.add(%u, %v) : (f64, f64) -> f64
    scf.yield %w : f64
  }
  warp.store %s, %y[%i] : f64, !warp.array<1 x f64>, si32
  return
}

// -----

func.func @computed(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>,
                    %n: i32) attributes {warp.kernel} {
  %one = warp.constant 1.0 : f32
  %two = warp.constant 2 : si32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : si32
  // expected-remark@+2 {{carried value 0 of type 'si32': rank 1, 0 bytes}}
  // expected-remark@+1 {{carried value 1 of type 'f32': rank 6, 324 bytes}}
  %s:2 = scf.for %k = %c0 to %n step %c1
      iter_args(%at = %i, %t = %one) -> (si32, f32) : i32 {
    %v = warp.load %x[%at] : !warp.array<1 x f32>, si32 -> f32
    %u = warp.mul(%t, %v) : (f32, f32) -> f32
    %next = warp.sub(%at, %two) : (si32, si32) -> si32
    scf.yield %next, %u : si32, f32
  }
  warp.store %s#1, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// An array cannot be kept: which row it is, only the iteration knows.
func.func @chosen(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>,
                  %p: !warp.array<1 x si32>, %q: !warp.array<2 x si32>,
                  %n: i32) attributes {warp.kernel} {
  %zero = warp.constant 0.0 : f32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : si32
  // expected-error@+1 {{the adjoint of this loop needs '!warp.array<1 x si32>' values that it carries, which cannot be kept; choose the array outside of the loop, or by an index}}
  %s:2 = scf.for %k = %c0 to %n step %c1
      iter_args(%a = %p, %t = %zero)
      -> (!warp.array<1 x si32>, f32) : i32 {
    %at = warp.load %a[%i] : !warp.array<1 x si32>, si32 -> si32
    %v = warp.load %x[%at] : !warp.array<1 x f32>, si32 -> f32
    %u = warp.mul(%t, %v) : (f32, f32) -> f32
    %b = warp.view %q[%at] : !warp.array<2 x si32>, si32 -> !warp.array<1 x si32>
    scf.yield %b, %u : !warp.array<1 x si32>, f32
  }
  warp.store %s#1, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// Iterations whose sums are in a branch, or in a loop within, have no order
// either: what they carry besides is recovered as it comes.
func.func @sums_in_branches(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>,
                            %next: !warp.array<1 x si32>)
    attributes {warp.kernel} {
  %zero = warp.constant 0.0 : f32
  %none = warp.constant 0 : si32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %c3 = arith.constant 3 : i32
  %i = warp.tid : si32
  // expected-remark@+1 {{carried value 0 of type 'si32': rank 3, 0 bytes}}
  %s:2 = scf.while (%at = %i, %t = %zero) : (si32, f32) -> (si32, f32) {
    %more = warp.gt(%at, %none) : (si32, si32) -> i1
    scf.condition(%more) %at, %t : si32, f32
  } do {
  ^bb0(%at: si32, %t: f32):
    %v = warp.load %x[%at] : !warp.array<1 x f32>, si32 -> f32
    %q = warp.mul(%v, %v) : (f32, f32) -> f32
    %is = warp.gt(%v, %zero) : (f32, f32) -> i1
    %u = scf.if %is -> (f32) {
      %a = warp.add(%t, %q) : (f32, f32) -> f32
      scf.yield %a : f32
    } else {
      scf.yield %t : f32
    }
    %w = scf.for %k = %c0 to %c3 step %c1 iter_args(%r = %u) -> f32 : i32 {
      %a = warp.sub(%r, %q) : (f32, f32) -> f32
      scf.yield %a : f32
    }
    %to = warp.load %next[%at] : !warp.array<1 x si32>, si32 -> si32
    scf.yield %to, %w : si32, f32
  }
  warp.store %s#1, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// A condition bounds the number of iterations: the loop that counts them keeps
// the values.
func.func @bounded(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %one = warp.constant 1.0 : f32
  %small = warp.constant 0.001 : f32
  %first = warp.constant -4 : si32
  %step = warp.constant 3 : si32
  %end = warp.constant 40 : si32
  %i = warp.tid : si32
  // expected-remark@+1 {{carried value 1 of type 'f32': rank 5, 60 bytes}}
  %s:2 = scf.while (%k = %first, %t = %one) : (si32, f32) -> (si32, f32) {
    %large = warp.gt(%t, %small) : (f32, f32) -> i1
    %more = warp.lt(%k, %end) : (si32, si32) -> i1
    %both = warp.bit_and(%large, %more) : (i1, i1) -> i1
    scf.condition(%both) %k, %t : si32, f32
  } do {
  ^bb0(%k: si32, %t: f32):
    %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
    %u = warp.sin(%t) : (f32) -> f32
    %w = warp.mul(%u, %v) : (f32, f32) -> f32
    %next = warp.add(%step, %k) : (si32, si32) -> si32
    scf.yield %next, %w : si32, f32
  }
  warp.store %s#1, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// The counter stands still where the value is negative: no bound.
func.func @unbounded(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %one = warp.constant 1.0 : f32
  %zero = warp.constant 0.0 : f32
  %first = warp.constant 0 : si32
  %step = warp.constant 1 : si32
  %end = warp.constant 40 : si32
  %i = warp.tid : si32
  // expected-remark@+1 {{carried value 1 of type 'f32': rank 6, 324 bytes}}
  %s:2 = scf.while (%k = %first, %t = %one) : (si32, f32) -> (si32, f32) {
    %more = warp.lt(%k, %end) : (si32, si32) -> i1
    scf.condition(%more) %k, %t : si32, f32
  } do {
  ^bb0(%k: si32, %t: f32):
    %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
    %u = warp.sin(%t) : (f32) -> f32
    %w = warp.mul(%u, %v) : (f32, f32) -> f32
    %after = warp.add(%step, %k) : (si32, si32) -> si32
    %stays = warp.lt(%w, %zero) : (f32, f32) -> i1
    %next = warp.where(%stays, %k, %after) : (i1, si32, si32) -> si32
    scf.yield %next, %w : si32, f32
  }
  warp.store %s#1, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

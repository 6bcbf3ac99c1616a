// RUN: warp-opt %s --warp-forward-stores --warp-differentiate-kernel=active=11 --canonicalize --cse --warp-clean-up-adjoint --split-input-file --verify-diagnostics

// A neighbour that another thread writes.
func.func @race(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.arg_names = ["x", "y"]} {
  %i = warp.tid : si32
  %one = warp.constant 1 : si32
  %j = warp.add(%i, %one) : (si32, si32) -> si32
  // expected-error @+1 {{'x' is read here, and other threads of the launch may write what is read}}
  %a = warp.load %x[%j] : !warp.array<1 x f32>, si32 -> f32
  // expected-note @+1 {{'x' is written here}}
  warp.store %a, %x[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// A later iteration may overwrite what the derivative of the product needs, and
// an earlier one what was there before the launch. The kernel cannot run again to
// keep it: the atomic in the loop would return something else.
func.func @overwritten(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>,
                       %n: i32, %p: !warp.array<1 x si32>,
                       %q: !warp.array<1 x si32>)
    attributes {warp.kernel, warp.arg_names = ["x", "y"]} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %zero = warp.constant 0 : si32
  %one = warp.constant 1 : si32
  scf.for %c = %c0 to %n step %c1 : i32 {
    %i = warp.cast %c : i32 to si32
    %k = warp.load %p[%i] : !warp.array<1 x si32>, si32 -> si32
    %old = warp.atomic add %one, %q[%zero] : si32, !warp.array<1 x si32>, si32 -> si32
    warp.store %old, %q[%one] : si32, !warp.array<1 x si32>, si32
    // expected-error @+1 {{the derivative needs what 'x' holds here, but the launch overwrites it (line 37); keep the value in a variable, or write to another array}}
    %a = warp.load %x[%k] : !warp.array<1 x f32>, si32 -> f32
    %b = warp.mul(%a, %a) : (f32, f32) -> f32
    warp.store %b, %x[%k] : f32, !warp.array<1 x f32>, si32
  }
  return
}

// -----

func.func @exchange(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %zero = warp.constant 0 : si32
  %a = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  // expected-error @+1 {{has no derivative: its result depends on the order of threads}}
  %b = warp.atomic exch %a, %y[%zero] : f32, !warp.array<1 x f32>, si32 -> f32
  return
}

// -----

// The effects of native code on memory have no derivative unless the user gives
// one.
func.func @native(%x: !warp.array<1 x f32>) attributes {warp.kernel} {
  %p = warp.pointer %x : !warp.array<1 x f32> -> ui64
  // expected-error @below {{native code with arrays has no derivative: give `@wp.func_native` an `adj_snippet`}}
  %0 = warp.library_call "warp_native_memory_0"(%p) : (ui64) -> si32
  return
}

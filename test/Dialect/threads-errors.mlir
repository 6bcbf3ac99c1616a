// RUN: warp-opt %s -verify-diagnostics -split-input-file

func.func @tid_c1_none() {
  // expected-error@+1 {{(C1) expects 1 to 4 results, but got 0}}
  "warp.tid"() : () -> ()
  return
}

// -----

func.func @tid_c1_five() {
  // expected-error@+1 {{(C1) expects 1 to 4 results, but got 5}}
  %0:5 = warp.tid : si32, si32, si32, si32, si32
  return
}

// -----

func.func @printf_c2(%i: si32) {
  // expected-error@+1 {{(C2) the format has 2 conversions, but there are 1 operands}}
  warp.printf "%d 100%% %d"(%i) : si32
  return
}

// -----

func.func @printf_c1(%i: si32) {
  // expected-error@+1 {{(C1) expects at most 32 operands, but got 33}}
  warp.printf "none"(%i, %i, %i, %i, %i, %i, %i, %i, %i, %i, %i, %i, %i, %i, %i, %i, %i, %i, %i, %i, %i, %i, %i, %i, %i, %i, %i, %i, %i, %i, %i, %i, %i)
    : si32, si32, si32, si32, si32, si32, si32, si32, si32, si32, si32, si32, si32, si32, si32, si32, si32, si32, si32, si32, si32, si32, si32, si32, si32, si32, si32, si32, si32, si32, si32, si32, si32
  return
}

// -----

// expected-error@+1 {{a kernel has no results, but this one has 1}}
func.func @kernel_results(%x: f32) -> f32 attributes {warp.kernel} {
  return %x : f32
}

// -----

// expected-error@+1 {{argument 1 of a kernel must be a scalar, composite, array or struct, but is 'index'}}
func.func @kernel_arguments(%x: f32, %n: index) attributes {warp.kernel} {
  return
}

// -----

// expected-error@+1 {{'warp.kernel' is a unit attribute of a 'func.func'}}
module attributes {warp.kernel} {}

// -----

func.func @load_components_c1(%a: !warp.array<2 x f32>, %i: i32) {
  // expected-error@+1 {{(C1) expects 2 indices for '!warp.array<2 x f32>', but got 1}}
  %0 = warp.load_components %a[%i] : !warp.array<2 x f32>, i32 -> f32
  return
}

// -----

func.func @load_components_c2_count(%a: !warp.array<1 x !warp.vec<3 x f32>>, %i: i32) {
  // expected-error@+1 {{(C2) elements of '!warp.array<1 x !warp.vec<3 x f32>>' have 3 components, but there are 2 results}}
  %0:2 = warp.load_components %a[%i] : !warp.array<1 x !warp.vec<3 x f32>>, i32 -> f32, f32
  return
}

// -----

// Signs are gone in thread IR.
func.func @load_components_c2_sign(%a: !warp.array<1 x si32>, %i: i32) {
  // expected-error@+1 {{(C2) component 0 of '!warp.array<1 x si32>' is 'i32' in thread IR, but among the results is 'si32'}}
  %0 = warp.load_components %a[%i] : !warp.array<1 x si32>, i32 -> si32
  return
}

// -----

func.func @store_components_c2(%a: !warp.array<1 x f32>, %i: i32, %x: f64) {
  // expected-error@+1 {{(C2) component 0 of '!warp.array<1 x f32>' is 'f32' in thread IR, but among the operands is 'f64'}}
  warp.store_components (%x), %a[%i] : (f64), !warp.array<1 x f32>, i32
  return
}

// -----

func.func @atomic_components_c2(%a: !warp.array<1 x f32>, %i: i32, %x: f32) {
  // expected-error@+1 {{(C2) elements of '!warp.array<1 x f32>' have 1 components, but there are 2 operands}}
  %0 = warp.atomic_components add(%x, %x), %a[%i] : (f32, f32), !warp.array<1 x f32>, i32 -> f32
  return
}

// -----

func.func @address_c1(%a: !warp.array<2 x f32>, %i: i32) {
  // expected-error@+1 {{(C1) expects 2 indices for '!warp.array<2 x f32>', but got 1}}
  %0 = warp.address %a[%i] : !warp.array<2 x f32>, i32
  return
}

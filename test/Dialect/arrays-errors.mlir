// RUN: warp-opt %s -verify-diagnostics -split-input-file

func.func @load_c1(%a: !warp.array<2 x f32>, %i: si32) {
  // expected-error@+1 {{(C1) expects 2 indices for '!warp.array<2 x f32>', but got 1}}
  %0 = warp.load %a[%i] : !warp.array<2 x f32>, si32 -> f32
  return
}

// -----

func.func @load_c2(%a: !warp.array<1 x f32>, %i: si32) {
  // expected-error@+1 {{(C2) elements of '!warp.array<1 x f32>' have type 'f32', but the result has type 'f64'}}
  %0 = warp.load %a[%i] : !warp.array<1 x f32>, si32 -> f64
  return
}

// -----

func.func @load_index(%a: !warp.array<1 x f32>, %i: f32) {
  // expected-error@+1 {{operand #1 must be variadic of a signed or unsigned integer, but got 'f32'}}
  %0 = warp.load %a[%i] : !warp.array<1 x f32>, f32 -> f32
  return
}

// -----

func.func @store_c1(%a: !warp.array<1 x f32>, %x: f32) {
  // expected-error@+1 {{(C1) expects 1 indices}}
  "warp.store"(%x, %a) : (f32, !warp.array<1 x f32>) -> ()
  return
}

// -----

func.func @store_c2(%a: !warp.array<1 x f32>, %i: si32) {
  // expected-error@+1 {{(C2) elements of '!warp.array<1 x f32>' have type 'f32', but the value has type 'si32'}}
  warp.store %i, %a[%i] : si32, !warp.array<1 x f32>, si32
  return
}

// -----

func.func @atomic_c1(%a: !warp.array<1 x f32>, %x: f32, %i: si32) {
  // expected-error@+1 {{(C1) expects 1 indices}}
  %0 = warp.atomic add %x, %a[%i, %i] : f32, !warp.array<1 x f32>, si32, si32 -> f32
  return
}

// -----

func.func @atomic_c2(%a: !warp.array<1 x f32>, %x: f32, %i: si32) {
  // expected-error@+1 {{(C2) elements of '!warp.array<1 x f32>' have type 'f32', but the result has type 'f64'}}
  %0 = warp.atomic add %x, %a[%i] : f32, !warp.array<1 x f32>, si32 -> f64
  return
}

// -----

func.func @atomic_c3(%a: !warp.array<1 x i1>, %x: i1, %i: si32) {
  // expected-error@+1 {{(C3) expects elements of numbers, but got 'i1'}}
  %0 = warp.atomic max %x, %a[%i] : i1, !warp.array<1 x i1>, si32 -> i1
  return
}

// -----

func.func @atomic_c3_bitwise(%a: !warp.array<1 x f32>, %x: f32, %i: si32) {
  // expected-error@+1 {{(C3) 'xor' expects elements of integers, but got 'f32'}}
  %0 = warp.atomic xor %x, %a[%i] : f32, !warp.array<1 x f32>, si32 -> f32
  return
}

// -----

func.func @atomic_cas_c3(%a: !warp.array<1 x i1>, %x: i1, %i: si32) {
  // expected-error@+1 {{(C3) expects numbers, but got 'i1'}}
  %0 = warp.atomic_cas %x, %x, %a[%i] : i1, i1, !warp.array<1 x i1>, si32 -> i1
  return
}

// -----

func.func @array_at_c1(%p: ui64, %n: si32) {
  // expected-error@+1 {{(C1) expects 2 extents for '!warp.array<2 x f32>', but got 1}}
  %0 = warp.array_at %p[%n] : ui64, si32 -> !warp.array<2 x f32>
  return
}

// -----

func.func @array_at_c2(%p: ui64, %n: si32) {
  // expected-error@+1 {{(C2) elements of '!warp.array<1 x si32>' have no derivatives}}
  %0 = warp.array_at %p[%n] grad(%p : ui64) : ui64, si32 -> !warp.array<1 x si32>
  return
}

// -----

func.func @stride_c1(%a: !warp.array<1 x f32>) {
  // expected-error@+1 {{(C1) dimension 1 is out of range for '!warp.array<1 x f32>'}}
  %0 = warp.stride %a, 1 : !warp.array<1 x f32> -> si32
  return
}

// -----

func.func @index_dim_c1(%a: !warp.array<2 x f32>, %i: si32) {
  // expected-error@+1 {{(C1) dimension 2 is out of range for '!warp.array<2 x f32>'}}
  %0 = warp.index_dim %a[%i] dim 2 : !warp.array<2 x f32>, si32 -> !warp.array<1 x f32>
  return
}

// -----

func.func @index_dim_c2(%a: !warp.array<2 x f32>, %i: si32) {
  // expected-error@+1 {{(C2) expects an array of one dimension less than '!warp.array<2 x f32>', but got '!warp.array<2 x f32>'}}
  %0 = warp.index_dim %a[%i] dim 1 : !warp.array<2 x f32>, si32 -> !warp.array<2 x f32>
  return
}

// -----

func.func @view_c1(%a: !warp.array<1 x f32>, %i: si32) {
  // expected-error@+1 {{(C1) expects at least 1 index and fewer than 1 for '!warp.array<1 x f32>', but got 1}}
  %0 = warp.view %a[%i] : !warp.array<1 x f32>, si32 -> !warp.array<1 x f32>
  return
}

// -----

func.func @view_c2(%a: !warp.array<3 x f32>, %i: si32) {
  // expected-error@+1 {{(C2) expects a result of type '!warp.array<2 x f32>', but got '!warp.array<1 x f32>'}}
  %0 = warp.view %a[%i] : !warp.array<3 x f32>, si32 -> !warp.array<1 x f32>
  return
}

// -----

func.func @slice_c1(%a: !warp.array<3 x f32>, %i: si32) {
  // expected-error@+1 {{(C1) dimension 3 is out of range for '!warp.array<3 x f32>'}}
  %0 = warp.slice %a[%i : %i : %i] dim 3 : !warp.array<3 x f32>, si32, si32, si32
  return
}

// -----

func.func @component_view_c1(%a: !warp.array<1 x f32>, %i: si32) {
  // expected-error@+1 {{(C1) 1 indices select no part of 'f32'}}
  %0 = warp.component_view %a[%i] : !warp.array<1 x f32>, si32 -> !warp.array<1 x f32>
  return
}

// -----

func.func @component_view_c1_field(%a: !warp.array<1 x !warp.struct<"S", {x: f32}>>) {
  // expected-error@+1 {{(C1) struct 'S' has no field 'y'}}
  %0 = warp.component_view %a[] field "y" : !warp.array<1 x !warp.struct<"S", {x: f32}>> -> !warp.array<1 x f32>
  return
}

// -----

func.func @component_view_c2(%a: !warp.array<1 x !warp.quat<f32>>, %i: si32) {
  // expected-error@+1 {{(C2) expects a result of type '!warp.array<1 x f32>', but got '!warp.array<1 x f64>'}}
  %0 = warp.component_view %a[%i] : !warp.array<1 x !warp.quat<f32>>, si32 -> !warp.array<1 x f64>
  return
}

// -----

func.func @dim_c1(%a: !warp.array<1 x f32>) {
  // expected-error@+1 {{(C1) dimension -1 is out of range}}
  %0 = warp.dim %a, -1 : !warp.array<1 x f32> -> si32
  return
}

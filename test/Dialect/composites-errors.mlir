// RUN: warp-opt %s -verify-diagnostics -split-input-file

!v3 = !warp.vec<3 x f32>

func.func @constant_c1() {
  // expected-error@+1 {{result #0 must be a boolean, integer or float, but got 'i32'}}
  %0 = warp.constant 1 : i32
  return
}

// -----

func.func @cast_c1(%v: !warp.vec<3 x f32>) {
  // expected-error@+1 {{(C1) expects two scalars, or two composites of the same kind and shape, but got '!warp.vec<3 x f32>' and '!warp.vec<2 x f32>'}}
  %0 = warp.cast %v : !warp.vec<3 x f32> to !warp.vec<2 x f32>
  return
}

// -----

func.func @cast_c1_kinds(%q: !warp.quat<f32>) {
  // expected-error@+1 {{(C1) expects two scalars}}
  %0 = warp.cast %q : !warp.quat<f32> to !warp.vec<4 x f32>
  return
}

// -----

// No type of that kind takes integers.
func.func @cast_c1_element(%q: !warp.quat<f32>, %v: !warp.vec<3 x si32>) {
  // expected-error@+1 {{(C1) expects two scalars}}
  %0 = warp.cast %q : !warp.quat<f32> to !warp.vec<4 x si32>
  return
}

// -----

func.func @bitcast_c1(%x: f32) {
  // expected-error@+1 {{(C1) expects types of the same size, but 'f32' has 4 bytes and 'si64' has 8}}
  %0 = warp.bitcast %x : f32 to si64
  return
}

// -----

func.func @construct_c1(%x: f32) {
  // expected-error@+1 {{(C1) expects 3 components, 1 or 0 for '!warp.vec<3 x f32>', but got 2}}
  %0 = warp.construct(%x, %x) : (f32, f32) -> !warp.vec<3 x f32>
  return
}

// -----

func.func @construct_c2(%i: si32) {
  // expected-error@+1 {{(C2) expects components of type 'f32', but got 'si32'}}
  %0 = warp.construct(%i) : (si32) -> !warp.vec<3 x f32>
  return
}

// -----

func.func @extract_c1(%v: !warp.vec<3 x f32>, %i: si32) {
  // expected-error@+1 {{(C1) expects 1 index for '!warp.vec<3 x f32>', but got 2}}
  %0 = warp.extract %v[%i, %i] : !warp.vec<3 x f32>, si32, si32 -> f32
  return
}

// -----

func.func @extract_c1_matrix(%m: !warp.mat<2x3 x f32>) {
  // expected-error@+1 {{(C1) expects 1 or 2 indices for '!warp.mat<2x3 x f32>', but got 0}}
  %0 = "warp.extract"(%m) : (!warp.mat<2x3 x f32>) -> f32
  return
}

// -----

func.func @extract_c2(%m: !warp.mat<2x3 x f32>, %i: si32) {
  // expected-error@+1 {{(C2) '!warp.mat<2x3 x f32>' with 1 indices has parts of type '!warp.vec<3 x f32>', but got 'f32'}}
  %0 = warp.extract %m[%i] : !warp.mat<2x3 x f32>, si32 -> f32
  return
}

// -----

func.func @insert_c1(%v: !warp.vec<3 x f32>, %x: f32, %i: si32) {
  // expected-error@+1 {{(C1) expects 1 index}}
  %0 = warp.insert %x, %v[%i, %i] : f32, !warp.vec<3 x f32>, si32, si32
  return
}

// -----

func.func @insert_c2(%v: !warp.vec<3 x f32>, %x: f64, %i: si32) {
  // expected-error@+1 {{(C2) '!warp.vec<3 x f32>' with 1 indices has parts of type 'f32', but got 'f64'}}
  %0 = warp.insert %x, %v[%i] : f64, !warp.vec<3 x f32>, si32
  return
}

// -----

func.func @struct_create_c1_count(%x: f32) {
  // expected-error@+1 {{(C1) struct 'S' has 2 fields, but got 1 operands}}
  %0 = warp.struct_create(%x) : (f32) -> !warp.struct<"S", {x: f32, y: f32}>
  return
}

// -----

func.func @struct_create_c1_type(%x: f64) {
  // expected-error@+1 {{(C1) field 'x' has type 'f32', but got 'f64'}}
  %0 = warp.struct_create(%x) : (f64) -> !warp.struct<"S", {x: f32}>
  return
}

// -----

func.func @struct_get_c1_name(%s: !warp.struct<"S", {x: f32, y: f32}>) {
  // expected-error@+1 {{(C1) struct 'S' has no field 'z'; it has 'x', 'y'}}
  %0 = warp.struct_get %s["z"] : !warp.struct<"S", {x: f32, y: f32}> -> f32
  return
}

// -----

func.func @struct_get_c1_type(%s: !warp.struct<"S", {x: f32}>) {
  // expected-error@+1 {{(C1) field 'x' has type 'f32', but got 'f64'}}
  %0 = warp.struct_get %s["x"] : !warp.struct<"S", {x: f32}> -> f64
  return
}

// -----

func.func @struct_set_c1(%s: !warp.struct<"S", {x: f32}>, %i: si32) {
  // expected-error@+1 {{(C1) field 'x' has type 'f32', but got 'si32'}}
  %0 = warp.struct_set %i, %s["x"] : si32, !warp.struct<"S", {x: f32}>
  return
}

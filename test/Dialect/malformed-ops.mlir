// RUN: warp-opt %s -verify-diagnostics -split-input-file

func.func @unknown() {
  // expected-error@+1 {{unregistered operation 'warp.unknown' found in dialect ('warp') that does not allow unknown operations}}
  "warp.unknown"() : () -> ()
  return
}

// -----

func.func @constant_without_value() {
  // expected-error@+1 {{requires attribute 'value'}}
  %0 = "warp.constant"() : () -> si32
  return
}

// -----

func.func @constant_range() {
  // expected-error@+1 {{integer constant out of range for attribute}}
  %0 = warp.constant 256 : ui8
  return
}

// -----

func.func @constant_tensor() {
  // expected-error@+1 {{result #0 must be a boolean, integer or float, but got 'tensor<2xf32>'}}
  %0 = warp.constant dense<1.0> : tensor<2xf32>
  return
}

// -----

func.func @builtin_without_operands() {
  // expected-error@+1 {{(C1) no overload of 'cross' takes ()}}
  "warp.cross"() : () -> ()
  return
}

// -----

func.func @builtin_with_region(%v: !warp.vec<3 x f32>) {
  // expected-error@+1 {{requires zero regions}}
  "warp.cross"(%v, %v) ({}) : (!warp.vec<3 x f32>, !warp.vec<3 x f32>) -> !warp.vec<3 x f32>
  return
}

// -----

func.func @builtin_of_foreign_type(%t: tensor<2xf32>, %n: none) {
  // expected-error@+1 {{(C1) no overload of '+' takes (tensor<2xf32>, none)}}
  %0 = "warp.add"(%t, %n) : (tensor<2xf32>, none) -> tensor<2xf32>
  return
}

// -----

func.func @builtin_count(%x: f32) {
  // expected-error@+1 {{operation defines 1 results but was provided 2 to bind}}
  %0:2 = warp.add(%x, %x) : (f32, f32) -> f32
  return
}

// -----

func.func @load_without_operands() {
  // expected-error@+1 {{expected 1 or more operands, but found 0}}
  %0 = "warp.load"() : () -> f32
  return
}

// -----

func.func @load_of_scalar(%x: f32) {
  // expected-error@+1 {{operand #0 must be a warp array, but got 'f32'}}
  %0 = "warp.load"(%x) : (f32) -> f32
  return
}

// -----

func.func @construct_of_none(%n: none) {
  // expected-error@+1 {{operand #0 must be variadic of a scalar, composite or struct, but got 'none'}}
  %0 = "warp.construct"(%n) : (none) -> !warp.vec<3 x f32>
  return
}

// -----

func.func @construct_of_struct(%s: !warp.struct<"S", {}>) {
  // expected-error@+1 {{(C2) expects components of type 'f32', but got '!warp.struct<"S", {}>'}}
  %0 = "warp.construct"(%s) : (!warp.struct<"S", {}>) -> !warp.vec<3 x f32>
  return
}

// -----

func.func @segments_too_many(%a: !warp.array<1 x f32>, %i: i32, %x: f32) {
  // expected-error@+1 {{operand count (3) does not match with the total size (7) specified in attribute 'operandSegmentSizes'}}
  "warp.store_components"(%x, %a, %i) {operandSegmentSizes = array<i32: 5, 1, 1>} : (f32, !warp.array<1 x f32>, i32) -> ()
  return
}

// -----

func.func @segments_negative(%a: !warp.array<1 x f32>, %i: i32, %x: f32) {
  // expected-error@+1 {{operandSegmentSizes}}
  "warp.store_components"(%x, %a, %i) {operandSegmentSizes = array<i32: -1, 1, 3>} : (f32, !warp.array<1 x f32>, i32) -> ()
  return
}

// -----

func.func @atomic_kind(%a: !warp.array<1 x f32>, %i: si32, %x: f32) {
  // expected-error@+1 {{attribute 'kind' failed to satisfy constraint: how an atomic combines}}
  %0 = "warp.atomic"(%x, %a, %i) {kind = 77 : i32} : (f32, !warp.array<1 x f32>, si32) -> f32
  return
}

// -----

func.func @slice_dim(%a: !warp.array<1 x f32>, %i: si32) {
  // expected-error@+1 {{attribute 'dim' failed to satisfy constraint: 64-bit signless integer attribute}}
  %0 = "warp.slice"(%a, %i, %i, %i) {dim = "x"} : (!warp.array<1 x f32>, si32, si32, si32) -> !warp.array<1 x f32>
  return
}

// -----

func.func @struct_get_field(%s: !warp.struct<"S", {}>) {
  // expected-error@+1 {{requires attribute 'field'}}
  %0 = "warp.struct_get"(%s) : (!warp.struct<"S", {}>) -> f32
  return
}

// -----

func.func @printf_format() {
  // expected-error@+1 {{requires attribute 'format'}}
  "warp.printf"() : () -> ()
  return
}

// -----

func.func @unterminated(%x: f32) {
  // expected-error@+1 {{expected}}
  %0 = warp.add(%x, %x : (f32, f32) -> f32
  return
}

// -----

func.func @undefined() {
  // expected-error@+1 {{use of undeclared SSA value name}}
  %0 = warp.neg(%missing) : (f32) -> f32
  return
}

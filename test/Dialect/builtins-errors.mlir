// RUN: warp-opt %s -verify-diagnostics -split-input-file

// The text says what was passed and what to write.
func.func @c1_mixed(%x: f32, %i: si32) {
  // expected-error@+1 {{(C1) no overload of '*' takes (float32, int32); use `float(...)` for operand 2}}
  %0 = warp.mul(%x, %i) : (f32, si32) -> f32
  return
}

// -----

// Both operands of a quotient of integers with a float.
func.func @c1_mixed_vector(%v: !warp.vec<3 x f32>, %i: si64) {
  // expected-error@+1 {{(C1) no overload of '/' takes (vec3f, int64); use `float(...)` for operand 2}}
  %0 = warp.div(%v, %i) : (!warp.vec<3 x f32>, si64) -> !warp.vec<3 x f32>
  return
}

// -----

func.func @c1_precision(%x: f32, %y: f64) {
  // expected-error@+1 {{(C1) no overload of '+' takes (float32, float64); use `float64(...)` for operand 1}}
  %0 = warp.add(%x, %y) : (f32, f64) -> f64
  return
}

// -----

func.func @c1_composites(%v: !warp.vec<3 x f32>, %w: !warp.vec<3 x f64>) {
  // expected-error@+1 {{(C1) no overload of 'dot' takes (vec3f, vec3d); use `vec3d(...)` for operand 1}}
  %0 = warp.dot(%v, %w) : (!warp.vec<3 x f32>, !warp.vec<3 x f64>) -> f64
  return
}

// -----

func.func @c1_function_of_floats(%i: si32) {
  // expected-error@+1 {{(C1) no overload of 'sin' takes (int32); use `float(...)` for operand 1}}
  %0 = warp.sin(%i) : (si32) -> f32
  return
}

// -----

// Extents that differ have no fix; the overloads are listed.
func.func @c1_extents(%v: !warp.vec<3 x f32>, %w: !warp.vec<2 x f32>) {
  // expected-error-re@+1 {{(C1) no overload of 'dot' takes (vec3f, vec2f){{[[:space:]]+}}overloads:{{[[:space:]]+}}dot(a: vec<n, S>, b: vec<n, S>) -> S}}
  %0 = warp.dot(%v, %w) : (!warp.vec<3 x f32>, !warp.vec<2 x f32>) -> f32
  return
}

// -----

func.func @c1_count(%x: f32) {
  // expected-error@+1 {{(C1) no overload of 'sin' takes (float32, float32)}}
  %0 = warp.sin(%x, %x) : (f32, f32) -> f32
  return
}

// -----

func.func @c1_none() {
  // expected-error@+1 {{(C1) no overload of 'sin' takes ()}}
  %0 = warp.sin() : () -> f32
  return
}

// -----

// Types of thread IR are no operands of a builtin.
func.func @c1_signless(%i: i32) {
  // expected-error@+1 {{(C1) no overload of '+' takes (int32, int32)}}
  %0 = warp.add(%i, %i) : (i32, i32) -> i32
  return
}

// -----

func.func @c1_too_large(%v: !warp.vec<60000 x f32>) {
  // expected-error@+1 {{(C1) the result of 'diag' would have more than 65536 components}}
  %0 = warp.diag(%v) : (!warp.vec<60000 x f32>) -> f32
  return
}

// -----

func.func @c2_type(%v: !warp.vec<3 x f32>) {
  // expected-error@+1 {{(C2) expects results of types ('f32'), but got ('f64')}}
  %0 = warp.dot(%v, %v) : (!warp.vec<3 x f32>, !warp.vec<3 x f32>) -> f64
  return
}

// -----

func.func @c2_count(%s: ui32) {
  // expected-error@+1 {{(C2) expects results of types ('f32', 'ui32'), but got ('f32')}}
  %0 = warp.randf(%s) : (ui32) -> f32
  return
}

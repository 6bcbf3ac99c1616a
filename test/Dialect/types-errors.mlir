// RUN: warp-opt %s -verify-diagnostics -split-input-file

// expected-error@+1 {{(C1) expects a length between 1 and 65536, but got 0}}
func.func private @vec_c1(!warp.vec<0 x f32>)

// -----

// expected-error@+1 {{(C1) expects a length between 1 and 65536, but got -3}}
func.func private @vec_c1_negative(!warp.vec<-3 x f32>)

// -----

// expected-error@+1 {{(C1) expects a length between 1 and 65536, but got 65537}}
func.func private @vec_c1_huge(!warp.vec<65537 x f32>)

// -----

// expected-error@+1 {{(C2) expects a scalar element type, but got '!warp.vec<3 x f32>'}}
func.func private @vec_c2(!warp.vec<3 x !warp.vec<3 x f32>>)

// -----

// Signless integers exist only below the dialect.
// expected-error@+1 {{(C2) expects a scalar element type, but got 'i32'}}
func.func private @vec_c2_signless(!warp.vec<3 x i32>)

// -----

// expected-error@+1 {{(C1) expects a shape of 1 to 65536 components, but got '0x3'}}
func.func private @mat_c1(!warp.mat<0x3 x f32>)

// -----

// expected-error@+1 {{(C1) expects a shape of 1 to 65536 components, but got '65536x65536'}}
func.func private @mat_c1_huge(!warp.mat<65536x65536 x f32>)

// -----

// expected-error@+1 {{(C2) expects a scalar element type, but got 'si5'}}
func.func private @mat_c2(!warp.mat<2x2 x si5>)

// -----

// expected-error@+1 {{expects the shape of a matrix as 'rows x cols', but got 3 extents}}
func.func private @mat_shape(!warp.mat<2x2x2 x f32>)

// -----

// expected-error@+1 {{(C1) expects a floating-point element type, but got 'si32'}}
func.func private @quat_c1(!warp.quat<si32>)

// -----

// expected-error@+1 {{(C1) expects a floating-point element type, but got 'f80'}}
func.func private @transform_c1(!warp.transform<f80>)

// -----

// expected-error@+1 {{(C1) expects a rank of 1 to 4, but got 5}}
func.func private @array_c1(!warp.array<5 x f32>)

// -----

// expected-error@+1 {{(C2) expects a scalar, composite or struct as element type, but got '!warp.array<1 x f32>'}}
func.func private @array_c2(!warp.array<1 x !warp.array<1 x f32>>)

// -----

// expected-error@+1 {{(C1) struct 'S' has two fields 'x'}}
func.func private @struct_c1(!warp.struct<"S", {x: f32, x: f32}>)

// -----

// expected-error@+1 {{(C1) struct 'S' has a field without name}}
func.func private @struct_c1_empty(!warp.struct<"S", {"": f32}>)

// -----

// expected-error@+1 {{(C2) field 'x' must be a scalar, composite, array or struct, but is 'index'}}
func.func private @struct_c2(!warp.struct<"S", {x: index}>)

// -----

// expected-error@+1 {{(C3) struct 'S' has more than 65536 components or 64 levels}}
func.func private @struct_c3(!warp.struct<"S", {x: !warp.vec<65536 x f32>, y: f32}>)

// -----

// An array of structs has as many parts as one of its elements.
!half = !warp.struct<"H", {x: !warp.vec<40000 x f32>}>
// expected-error@+1 {{(C3) struct 'S' has more than 65536 components or 64 levels}}
func.func private @struct_c3_arrays(!warp.struct<"S", {x: !warp.array<1 x !half>, y: !warp.array<1 x !half>}>)

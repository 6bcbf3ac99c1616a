// RUN: warp-opt %s -verify-diagnostics -split-input-file

// expected-error@+2 {{integer value too large}}
// expected-error@+1 {{failed to parse Warp_VecType parameter 'length'}}
func.func private @f(!warp.vec<99999999999999999999 x f32>)

// -----

// expected-error@+1 {{(C1) expects a length between 1 and 65536, but got 9223372036854775807}}
func.func private @f(!warp.vec<9223372036854775807 x f32>)

// -----

// expected-error@+1 {{invalid dimension}}
func.func private @f(!warp.mat<99999999999999999999x2 x f32>)

// -----

// Their product does not fit 64 bits.
// expected-error@+1 {{(C1) expects a shape of 1 to 65536 components, but got '4294967296x4294967296'}}
func.func private @f(!warp.mat<4294967296x4294967296 x f32>)

// -----

// expected-error@+1 {{expected static shape}}
func.func private @f(!warp.mat<?x2 x f32>)

// -----

// expected-error@+1 {{expects the shape of a matrix as 'rows x cols', but got 1 extents}}
func.func private @f(!warp.mat<2 x f32>)

// -----

// expected-error@+1 {{expected 'x'}}
func.func private @f(!warp.vec<3 f32>)

// -----

// expected-error@+2 {{expected integer value}}
// expected-error@+1 {{failed to parse Warp_VecType parameter 'length'}}
func.func private @f(!warp.vec<f32>)

// -----

// expected-error@+1 {{expected non-function type}}
func.func private @f(!warp.vec<3 x >)

// -----

// expected-error@+1 {{unknown  type `tensor` in dialect `warp`}}
func.func private @f(!warp.tensor<3 x f32>)

// -----

// expected-error@+1 {{expected string}}
func.func private @f(!warp.struct<S, {x: f32}>)

// -----

// expected-error@+1 {{expected ':'}}
func.func private @f(!warp.struct<"S", {x f32}>)

// -----

// expected-error@+1 {{expected ','}}
func.func private @f(!warp.struct<"S">)

// -----

// A struct can't hold itself.
// expected-error@+1 {{undefined symbol alias id 's'}}
!s = !warp.struct<"S", {x: !s}>

// -----

// expected-error@+1 {{unbalanced '{' character in pretty dialect name}}
func.func private @f(!warp.struct<"S", {x: f32

// -----

// expected-error@+1 {{expected}}
func.func private @f(!warp.struct<"S

// RUN: warp-opt %s --split-input-file --verify-diagnostics

// expected-error @below {{(C1) expects extents of 1 or more, but got 0}}
func.func private @c1_extent(!warp.tile<0 x f32>)

// -----

func.func @c1_matmul(%a: !warp.tile<4x3 x f32>) {
  // expected-error @below {{(C1) expects tiles that fit}}
  %0 = warp.tile_matmul %a, %a : !warp.tile<4x3 x f32>, !warp.tile<4x3 x f32>
    -> !warp.tile<4x3 x f32>
  return
}

// -----

func.func @c1_broadcast(%a: !warp.tile<3 x f32>) {
  // expected-error @below {{(C1) expects extents that are 1 or the same}}
  %0 = warp.tile_broadcast %a : !warp.tile<3 x f32> -> !warp.tile<2x4 x f32>
  return
}

// -----

func.func @c1_reshape(%a: !warp.tile<3 x f32>) {
  // expected-error @below {{(C1) expects a tile of the same elements}}
  %0 = warp.tile_reshape %a : !warp.tile<3 x f32> -> !warp.tile<2x2 x f32>
  return
}

// -----

func.func @c1_cholesky_adjoint(%a: !warp.tile<3x3 x f16>) {
  // expected-error @below {{(C1) expects a square tile of f32 or f64}}
  %0 = warp.tile_cholesky_adjoint %a, %a : !warp.tile<3x3 x f16>
  return
}

// -----

func.func @c1_solve(%a: !warp.tile<3x4 x f32>, %b: !warp.tile<3 x f32>) {
  // expected-error @below {{(C1) expects a square tile of f32 or f64}}
  %0 = warp.tile_solve %a, %b : !warp.tile<3x4 x f32>, !warp.tile<3 x f32>
  return
}

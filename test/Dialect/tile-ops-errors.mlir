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

// -----

func.func @set_c2_path(%t: !warp.tile<3 x !warp.vec<3 x f32>>, %i: si32, %x: f64) {
  // expected-error @below {{(C2) expects a value of the type of the part that the path leads to}}
  %0 = warp.tile_set assign %x, %t[%i] part [1][%i] : f64, !warp.tile<3 x !warp.vec<3 x f32>>, (si32), (si32)
  return
}

// -----

func.func @set_c2_components(%t: !warp.tile<3 x !warp.vec<3 x f32>>, %i: si32, %x: f32) {
  // expected-error @below {{(C2) expects a value of the type of the part}}
  %0 = warp.tile_set assign %x, %t[%i] part [1][] : f32, !warp.tile<3 x !warp.vec<3 x f32>>, (si32)
  return
}

// -----

func.func @set_c2_no_field(%t: !warp.tile<3 x !warp.vec<3 x f32>>, %i: si32, %x: f32) {
  // expected-error @below {{(C2) expects a value of the type of the part}}
  %0 = warp.tile_set assign %x, %t[%i] part ["x", 7][] : f32, !warp.tile<3 x !warp.vec<3 x f32>>, (si32)
  return
}

// -----

func.func @tiles_in_a_function_of_elements(%t: !warp.tile<3 x f32>, %i: si32) {
  %0 = warp.tile_map(%t) {
  ^bb0(%a: f32):
    // expected-error @below {{cannot stand in a function of elements}}
    %b = warp.tile_get %t[%i] : !warp.tile<3 x f32>, (si32) -> f32
    warp.tile_yield %b : f32
  } : (!warp.tile<3 x f32>) -> !warp.tile<3 x f32>
  return
}

// -----

func.func @check_index_c1(%i: si32) {
  // expected-error @below {{(C1) expects 1 to 4 indices and as many extents, but got 1 and 2}}
  warp.check_index [%i] of [3, 4], "a matrix" : si32
  return
}

// -----

func.func @component_view_c1(%a: !warp.array<1 x !warp.transform<f32>>) {
  // expected-error @below {{(C1) a transform has the fields 'p' and 'q'}}
  %0 = warp.component_view %a[] field "x" : !warp.array<1 x !warp.transform<f32>> -> !warp.array<1 x f32>
  return
}

// RUN: warp-opt %s --split-input-file --verify-diagnostics

// (C1) a table has elements.
func.func @empty(%i: si32) {
  // expected-error @+1 {{(C1) expects a table of at least one element, but got 'tensor<0xf32>'}}
  %0 = warp.table_get dense<> : tensor<0xf32> [%i] : si32 -> f32
  return
}

// -----

// (C1) there is an index for each dimension.
func.func @indices(%i: si32) {
  // expected-error @+1 {{(C1) expects 2 indices for 'tensor<1x2xf32>', but got 1}}
  %0 = warp.table_get dense<[[1.0, 2.0]]> : tensor<1x2xf32> [%i] : si32 -> f32
  return
}

// -----

// (C2) indices are integers.
func.func @float_index(%x: f32) {
  // expected-error @+1 {{(C2) expects an integer as index, but got 'f32'}}
  %0 = warp.table_get dense<[1.0, 2.0]> : tensor<2xf32> [%x] : f32 -> f32
  return
}

// -----

// (C2) lanes have an index each.
func.func @lanes(%i: i32) {
  // expected-error @+1 {{(C2) expects an integer as index for each lane, but got 'i32'}}
  %0 = warp.table_get dense<[1.0, 2.0]> : tensor<2xf32> [%i] : i32 -> vector<4xf32>
  return
}

// -----

// (C3) the result has the element type.
func.func @element(%i: si32) {
  // expected-error @+1 {{(C3) the table has elements of type 'f32', but the result has type 'f64'}}
  %0 = warp.table_get dense<[1.0, 2.0]> : tensor<2xf32> [%i] : si32 -> f64
  return
}

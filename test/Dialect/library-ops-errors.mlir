// RUN: warp-opt %s --split-input-file --verify-diagnostics

func.func @c1_function(%x: f32) {
  // expected-error @below {{(C1) the device library has no function 'warp_nothing'}}
  %0 = warp.library_call "warp_nothing"(%x) : (f32) -> f32
  return
}

// -----

func.func @c2_types(%x: f32) {
  // expected-error @below {{(C2) 'warp_slot' takes 'hi' and gives 'l'}}
  %0 = warp.library_call "warp_slot"(%x) : (f32) -> ui64
  return
}

// -----

func.func @c3_scalars(%x: !warp.vec<3 x f32>) {
  // expected-error @below {{(C3) native code takes and gives scalars}}
  %0 = warp.library_call "warp_native_0"(%x) : (!warp.vec<3 x f32>) -> f32
  return
}

// -----

func.func @c3_results(%x: f32) {
  // expected-error @below {{(C3) native code takes and gives scalars}}
  warp.library_call "warp_native_memory_0"(%x) : (f32) -> ()
  return
}

// -----

// Only some functions have a form for lanes, which share the first operands.
func.func @c1_lanes(%x: vector<8xf32>, %mesh: ui64) {
  // expected-error @below {{(C1) the device library has no function 'warp_mesh_side_lanes'}}
  %0 = warp.library_call "warp_mesh_side_lanes"(%mesh, %x, %x, %x)
      : (ui64, vector<8xf32>, vector<8xf32>, vector<8xf32>) -> vector<8xf32>
  return
}

// -----

func.func @c2_shared(%i: vector<8xi32>, %volume: vector<8xi64>) {
  // expected-error @below {{(C2) 'warp_volume_index_lanes' takes 'hiii' and gives 'i'}}
  %0 = warp.library_call "warp_volume_index_lanes"(%volume, %i, %i, %i)
      : (vector<8xi64>, vector<8xi32>, vector<8xi32>, vector<8xi32>) -> vector<8xi32>
  return
}

// -----

func.func @c2_scalars(%i: i32, %volume: ui64) {
  // expected-error @below {{(C2) 'warp_volume_index_lanes' takes 'hiii' and gives 'i'}}
  %0 = warp.library_call "warp_volume_index_lanes"(%volume, %i, %i, %i)
      : (ui64, i32, i32, i32) -> i32
  return
}

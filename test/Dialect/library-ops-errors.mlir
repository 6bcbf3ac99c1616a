// RUN: warp-opt %s --split-input-file --verify-diagnostics

func.func @c1_function(%x: f32) {
  // expected-error @below {{(C1) the device library has no function 'warp_nothing'}}
  %0 = warp.library_call "warp_nothing"(%x) : (f32) -> f32
  return
}

// -----

func.func @c2_types(%x: f32) {
  // expected-error @below {{(C2) 'warp_slot' takes 'li' and gives 'l'}}
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

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

func.func @c1_address(%x: ui32, %n: si32) {
  // expected-error @below {{(C1) expects an address of 64 bits, but got 'ui32'}}
  %0 = warp.array_at %x[%n], 4 : ui32, si32 -> !warp.array<1 x f32>
  return
}

// -----

func.func @c2_extents(%x: ui64, %n: si32) {
  // expected-error @below {{(C2) expects 2 extents, but got 1}}
  %0 = warp.array_at %x[%n], 4 : ui64, si32 -> !warp.array<2 x f32>
  return
}

// RUN: warp-opt %s --verify-diagnostics --warp-pipeline=to-warp

// A function that calls itself is named at its place.

func.func private @f(%x: f32) {
  // expected-error @below {{the call of 'f' cannot be inlined; functions cannot call themselves}}
  call @f(%x) : (f32) -> ()
  return
}
func.func @k(%x: f32) attributes {warp.kernel} {
  call @f(%x) : (f32) -> ()
  return
}

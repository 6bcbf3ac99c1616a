// RUN: warp-opt %s --split-input-file --verify-diagnostics --warp-form-launch

// expected-error @below {{arguments do not match 'warp.arg_types'}}
func.func @mismatch(%x: f32) attributes {
    warp.kernel, warp.arg_types = [!warp.vec<2 x f32>]} {
  return
}

// -----

// expected-error @below {{expects types in 'warp.arg_types', but got "f32"}}
func.func @no_types(%x: f32) attributes {
    warp.kernel, warp.arg_types = ["f32"]} {
  return
}

// -----

// expected-error @below {{expects structured control flow}}
func.func @blocks() attributes {warp.kernel} {
  cf.br ^bb1
^bb1:
  return
}

// -----

// expected-error @below {{expects one function marked 'warp.kernel', but got 'a' and 'b'}}
module {
  func.func @a() attributes {warp.kernel} {
    return
  }
  func.func @b() attributes {warp.kernel} {
    return
  }
}

module {
  func.func @k(%arg0: !warp.array<1 x f32>) attributes {warp.arg_types = [!warp.array<1 x f32>], warp.kernel, warp.recipe = #warp.recipe<cost = 6>, warp.variant = #warp.variant<target = <platform = cuda, version = 90>>} {
    %0 = warp.tid : i32
    %1 = warp.load_components %arg0[%0] : !warp.array<1 x f32>, i32 -> f32
    %2 = arith.mulf %1, %1 : f32
    warp.store_components(%2), %arg0[%0] : (f32), !warp.array<1 x f32>, i32
    return
  }
}

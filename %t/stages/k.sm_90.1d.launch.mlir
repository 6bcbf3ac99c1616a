module {
  func.func @k(%arg0: !warp.array<1 x f32>) attributes {warp.arg_types = [!warp.array<1 x f32>], warp.kernel, warp.recipe = #warp.recipe<cost = 6>, warp.variant = #warp.variant<target = <platform = cuda, version = 90>>} {
    warp.group {
      warp.threads attributes {kinds = array<i32>, types = []} {
      ^bb0(%arg1: i32):
        %0 = warp.load_components %arg0[%arg1] : !warp.array<1 x f32>, i32 -> f32
        %1 = arith.mulf %0, %0 : f32
        warp.store_components(%1), %arg0[%arg1] : (f32), !warp.array<1 x f32>, i32
        warp.yield
      }
    }
    return
  }
}

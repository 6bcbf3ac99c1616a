module {
  func.func @k(%arg0: !warp.array<1 x f32>) attributes {warp.kernel} {
    %0 = warp.tid : si32
    %1 = warp.load %arg0[%0] : !warp.array<1 x f32>, si32 -> f32
    %2 = warp.mul(%1, %1) : (f32, f32) -> f32
    warp.store %2, %arg0[%0] : f32, !warp.array<1 x f32>, si32
    return
  }
}

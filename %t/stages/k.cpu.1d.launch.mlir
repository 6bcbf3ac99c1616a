module {
  func.func @k(%arg0: !warp.array<1 x f32>) attributes {warp.arg_types = [!warp.array<1 x f32>], warp.kernel, warp.recipe = #warp.recipe<cost = 6, lanes = 16>, warp.schedule = [["lanes", "16", "worth it", 0]], warp.variant = #warp.variant<target = <platform = cpu, bits = 256>>} {
    warp.group {
      warp.threads attributes {kinds = array<i32>, lanes = 16 : i64, types = []} {
      ^bb0(%arg1: i32, %arg2: vector<16xi1>):
        %0 = warp.lane_numbers : vector<16xi32>
        %1 = warp.broadcast %arg1 : i32 -> vector<16xi32>
        %2 = arith.addi %1, %0 : vector<16xi32>
        %3 = warp.load_lanes gather %arg0[%2] mask %arg2 {nonNegative = array<i1: true>} : !warp.array<1 x f32>, (vector<16xi32>), vector<16xi1> -> vector<16xf32>
        %4 = arith.mulf %3, %3 : vector<16xf32>
        warp.store_lanes gather(%4), %arg0[%2] mask %arg2 {nonNegative = array<i1: true>} : (vector<16xf32>), !warp.array<1 x f32>, (vector<16xi32>), vector<16xi1>
        warp.yield
      }
    }
    return
  }
}

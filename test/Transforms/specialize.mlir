// RUN: warp-opt %s --warp-specialize="rank=1 contiguous=1 block-dim=128" | FileCheck %s
// RUN: warp-opt %s --warp-specialize="rank=2 target=sm_90 index32=false debug=true" | FileCheck %s --check-prefix=GPU

// The facts become attributes; dimensions beyond the rank are zero, and a
// release build has no assertions.
// CHECK-LABEL: func.func @indices
// CHECK-SAME: warp.block_dim = 128
// CHECK-SAME: warp.contiguous = 1
// CHECK-SAME: warp.index32
// CHECK-SAME: warp.rank = 1
// CHECK-SAME: warp.target = "cpu"
// CHECK: %[[I:.*]] = warp.tid : si32
// CHECK: %[[ZERO:.*]] = warp.constant 0 : si32
// CHECK-NOT: warp.assert
// CHECK: warp.store %[[ZERO]], %{{.*}}[%[[I]]]

// GPU-LABEL: func.func @indices
// GPU-NOT: warp.index32
// GPU-SAME: warp.debug
// GPU-SAME: warp.target = "sm_90"
// GPU: warp.tid : si32, si32
// GPU: warp.assert
func.func @indices(%a: !warp.array<1 x si32>, %ok: i1)
    attributes {warp.kernel} {
  %i, %j = warp.tid : si32, si32
  warp.assert %ok, "is ok"
  warp.store %j, %a[%i] : si32, !warp.array<1 x si32>, si32
  return
}

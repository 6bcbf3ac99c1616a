// RUN: warp-opt %s --warp-specialize="rank=1 packed=1 block-dim=128" | FileCheck %s
// RUN: warp-opt %s --warp-specialize="rank=2 target=sm_90 index32=false debug=true" | FileCheck %s --check-prefix=GPU

// The facts become an attribute; dimensions beyond the rank are zero, and a
// release build has no assertions.
// CHECK-LABEL: func.func @indices
// CHECK-SAME: warp.variant = #warp.variant<target = <name = "cpu", bits = {{128|256|512}}>, block_dim = 128, packed = 1>
// CHECK: %[[I:.*]] = warp.tid : si32
// CHECK: %[[ZERO:.*]] = warp.constant 0 : si32
// CHECK-NOT: warp.assert
// CHECK: warp.store %[[ZERO]], %{{.*}}[%[[I]]]

// GPU-LABEL: func.func @indices
// GPU-SAME: #warp.variant<target = <name = "sm_90">, debug = true, index32 = false, rank = 2>
// GPU: warp.tid : si32, si32
// GPU: warp.assert
func.func @indices(%a: !warp.array<1 x si32>, %ok: i1)
    attributes {warp.kernel} {
  %i, %j = warp.tid : si32, si32
  warp.assert %ok, "is ok"
  warp.store %j, %a[%i] : si32, !warp.array<1 x si32>, si32
  return
}

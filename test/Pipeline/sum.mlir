// RUN: warp-opt %s --warp-emit=ptx --warp-options=packed=3,target=sm_90 | FileCheck %s

// A sum into one address: over the warp by shuffles, over the block through a
// few words of shared memory, then one atomic per block. Each thread comes to
// the update, so nobody asks whether one did, and none leaves before the
// barrier.
// CHECK-LABEL: .entry sum
// CHECK-NOT: .local
// CHECK: .shared {{.*}}[128]
// CHECK-NOT: ret;
// CHECK: ld.global.b32
// CHECK: bar.warp.sync
// CHECK-COUNT-5: shfl.sync.down.b32
// CHECK: st.shared
// CHECK: bar.sync
// CHECK: ld.shared
// CHECK-COUNT-5: shfl.sync.down.b32
// CHECK-COUNT-1: red.relaxed.gpu.global.add.f32
// CHECK-NOT: {{(atom|red)}}.
// CHECK: ret;
func.func @sum(%x: !warp.array<1 x f32>, %total: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.arg_names = ["x", "total"]} {
  %i = warp.tid : si32
  %zero = warp.constant 0 : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %old = warp.atomic add %v, %total[%zero]
    : f32, !warp.array<1 x f32>, si32 -> f32
  return
}

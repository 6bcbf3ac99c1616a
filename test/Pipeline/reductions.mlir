// RUN: warp-opt %s --warp-emit=ptx --warp-options="target=sm_90,packed=255" | FileCheck %s

// Updates whose old values have no use are instructions without a result.
// CHECK-LABEL: .entry updates
// CHECK: red.relaxed.gpu.global.add.f32
// CHECK: red.relaxed.gpu.global.add.f64
// CHECK: red.relaxed.gpu.global.min.s32
// CHECK: red.relaxed.gpu.global.or.b32
// CHECK: red.relaxed.gpu.global.max.u64
// CHECK: atom.global.add.f32
func.func @updates(%f: !warp.array<1 x f32>, %d: !warp.array<1 x f64>,
                   %i: !warp.array<1 x si32>, %u: !warp.array<1 x ui64>)
    attributes {warp.kernel} {
  %t = warp.tid : si32
  %x = warp.load %f[%t] : !warp.array<1 x f32>, si32 -> f32
  %y = warp.load %d[%t] : !warp.array<1 x f64>, si32 -> f64
  %k = warp.load %u[%t] : !warp.array<1 x ui64>, si32 -> ui64
  %zero = warp.constant 0 : si32
  %a = warp.atomic add %x, %f[%t] : f32, !warp.array<1 x f32>, si32 -> f32
  %b = warp.atomic sub %y, %d[%t] : f64, !warp.array<1 x f64>, si32 -> f64
  %c = warp.atomic min %t, %i[%t] : si32, !warp.array<1 x si32>, si32 -> si32
  %e = warp.atomic or %t, %i[%t] : si32, !warp.array<1 x si32>, si32 -> si32
  %g = warp.atomic max %k, %u[%t] : ui64, !warp.array<1 x ui64>, si32 -> ui64
  %old = warp.atomic add %x, %f[%t] : f32, !warp.array<1 x f32>, si32 -> f32
  warp.store %old, %f[%zero] : f32, !warp.array<1 x f32>, si32
  return
}

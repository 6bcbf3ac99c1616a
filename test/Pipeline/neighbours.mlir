// Neighbours in a hash grid are numbers that the runtime wrote: none is looked
// at for its sign, and where it is in the grid is none either.
//
// RUN: warp-opt %s --warp-emit=ptx \
// RUN:   --warp-options="target=sm_90,packed=255,non-negative=255,index32" | FileCheck %s

// CHECK-LABEL: .entry neighbours
// CHECK: [[LOOP:\$L__BB[0-9_]+]]:
// CHECK-NEXT: ld.global.b32 [[J:%r[0-9]+]]
// CHECK-NEXT: mul.wide.s32 %{{rd[0-9]+}}, [[J]], 12
// CHECK-NOT: {{setp|selp}}
// CHECK: setp.lt.s32 [[MORE:%p[0-9]+]]
// CHECK-NEXT: @[[MORE]] bra [[LOOP]]
func.func @neighbours(%grid: ui64, %n: si32,
    %x: !warp.array<1 x !warp.vec<3 x f32>>, %out: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %kind = warp.constant 1 : si32
  %words = warp.constant 32 : si32
  %which = warp.constant 11 : si32
  %zero = warp.constant 0 : si32
  %one = warp.constant 1 : si32
  %none = warp.constant 0.0 : f32
  %i = warp.tid : si32
  %at = warp.library_call "warp_slot"(%grid, %kind) : (ui64, si32) -> ui64
  %slot = warp.array_at %at[%words] : ui64, si32 -> !warp.array<1 x ui64>
  %where = warp.load %slot[%which] : !warp.array<1 x ui64>, si32 -> ui64
  %order = warp.array_at %where[%n] : ui64, si32 -> !warp.array<1 x si32>
  %last:2 = scf.while (%k = %i, %sum = %none) : (si32, f32) -> (si32, f32) {
    %more = warp.lt(%k, %n) : (si32, si32) -> i1
    scf.condition(%more) %k, %sum : si32, f32
  } do {
  ^bb0(%k: si32, %sum: f32):
    %j = warp.load %order[%k] : !warp.array<1 x si32>, si32 -> si32
    %p = warp.load %x[%j]
        : !warp.array<1 x !warp.vec<3 x f32>>, si32 -> !warp.vec<3 x f32>
    %square = warp.dot(%p, %p)
        : (!warp.vec<3 x f32>, !warp.vec<3 x f32>) -> f32
    %more = warp.add(%sum, %square) : (f32, f32) -> f32
    %next = warp.add(%k, %one) : (si32, si32) -> si32
    scf.yield %next, %more : si32, f32
  }
  warp.store %last#1, %out[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// REQUIRES: x86-64
// RUN: warp-opt %s --warp-pipeline="to-gpu target=cpu:x86-64-v4" | FileCheck %s

// Tiles in shared memory, and arrays that the launch was given, do not
// overlap: vector loops need not ask.
// CHECK: #[[BLOCK:.*]] = #llvm.alias_scope<{{.*}}"shared memory">
// CHECK-LABEL: llvm.func @twice(
// CHECK: llvm.load %{{.*}} {alignment = 4 : i64, noalias_scopes = [#[[BLOCK]]]}
// CHECK: llvm.store %{{.*}} {alias_scopes = [#[[BLOCK]]], alignment = 4 : i64}
// CHECK: llvm.load %{{.*}} {alias_scopes = [#[[BLOCK]]], alignment = 4 : i64}
// CHECK: llvm.store %{{.*}} {alignment = 4 : i64, noalias_scopes = [#[[BLOCK]]]}
func.func @twice(%a: !warp.array<1 x f32>, %b: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 1 : i64} {
  %c0 = warp.constant 0 : si32
  %t = warp.tile_load %a[%c0] : !warp.array<1 x f32>, (si32)
    -> !warp.tile<64 x f32>
  warp.tile_store %t, %b[%c0] : !warp.tile<64 x f32>, !warp.array<1 x f32>,
    (si32)
  warp.tile_store %t, %a[%c0] : !warp.tile<64 x f32>, !warp.array<1 x f32>,
    (si32)
  return
}

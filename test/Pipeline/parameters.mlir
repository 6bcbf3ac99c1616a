// RUN: warp-opt %s --warp-emit=parameters | FileCheck %s
// RUN: warp-opt %s --warp-emit=fingerprint > %t.1
// RUN: warp-opt %s --warp-emit=fingerprint > %t.2
// RUN: diff %t.1 %t.2
// RUN: warp-opt %s --warp-emit=fingerprint --warp-options=rank=2 > %t.3
// RUN: not diff %t.1 %t.3
// RUN: sed 's/3 x f32/4 x f32/' %s | warp-opt --warp-emit=fingerprint > %t.4
// RUN: not diff %t.1 %t.4

// Arguments lie at their natural alignment, after the header of 24 bytes.
// CHECK: a !warp.array<2 x !warp.vec<3 x f32>> offset 24 size 56 element !warp.vec<3 x f32> of 12 array at 0
// CHECK-NEXT: flag i1 offset 80 size 1
// CHECK-NEXT: v !warp.vec<3 x f32> offset 84 size 12
// CHECK-NEXT: s !warp.struct<"S", {n: si32, x: !warp.array<1 x f32>}> offset 96 size 64 array at 8
func.func @k(%a: !warp.array<2 x !warp.vec<3 x f32>>, %flag: i1,
             %v: !warp.vec<3 x f32>,
             %s: !warp.struct<"S", {n: si32, x: !warp.array<1 x f32>}>)
    attributes {warp.kernel, warp.arg_names = ["a", "flag", "v", "s"]} {
  return
}

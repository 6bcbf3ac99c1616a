// RUN: warp-opt %s --warp-widen-threads | FileCheck %s

#lanes = #warp.variant<target = <name = "cpu", bits = 256>, lanes = 4>

// Values that threads yield are combined over the group later; lanes that are
// not live yield what changes nothing.
// CHECK-LABEL: func.func @combined
// CHECK: ^bb0(%{{.*}}: i32, %[[LIVE:.*]]: vector<4xi1>):
// CHECK: %[[V:.*]] = warp.load_lanes
// CHECK: %[[NONE:.*]] = arith.constant dense<-0.000000e+00> : vector<4xf32>
// CHECK: %[[TERM:.*]] = arith.select %[[LIVE]], %[[V]], %[[NONE]]
// CHECK: warp.yield %[[TERM]] : vector<4xf32>
// CHECK-NEXT: } : f32
func.func @combined(%s: !warp.array<1 x f32>, %x: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #lanes} {
  warp.group {
    %sum = warp.threads attributes {kinds = array<i32: 0>, types = [f32]} {
    ^bb0(%i: i32):
      %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
      warp.yield %v : f32
    } : f32
    warp.once {
      %c0 = arith.constant 0 : i32
      %old = warp.atomic_components add(%sum), %s[%c0]
        : (f32), !warp.array<1 x f32>, i32 -> f32
    }
  }
  return
}

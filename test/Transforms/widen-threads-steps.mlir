// REQUIRES: x86-64
// RUN: warp-opt %s --warp-pipeline="to-launch disjoint target=cpu:x86-64-v4" | FileCheck %s
// RUN: warp-opt %s --warp-pipeline="to-launch disjoint lanes=1" | FileCheck %s --check-prefix=ALONE
// RUN: warp-opt %s --warp-pipeline="to-launch disjoint target=sm_90" | FileCheck %s --check-prefix=ALONE

// Lanes go through a loop for the most trips that one of them makes, and are at
// the same element: it is loaded once.
// CHECK-LABEL: func.func @steps
// CHECK: warp.threads
// CHECK-NEXT: ^bb0(%{{.*}}: i32, %[[LIVE:.*]]: vector<[[W:[0-9]+]]xi1>):
// CHECK: %[[OWN:.*]] = warp.load_lanes
// CHECK: %[[HERE:.*]] = arith.select %[[LIVE]], %[[OWN]], %{{.*}}
// CHECK: %[[MOST:.*]] = warp.combine_lanes %[[HERE]] {kind = 3 : i32, type = i32}
// CHECK: scf.for unsigned %[[K:.*]] = %{{.*}} to %[[MOST]]
// CHECK: %[[MADE:.*]] = arith.cmpi ult, %{{.*}}, %[[OWN]]
// CHECK: %[[MASK:.*]] = arith.andi %[[LIVE]], %[[MADE]]
// CHECK: %[[ANY:.*]] = warp.any %[[MASK]]
// CHECK: scf.if %[[ANY]]
// CHECK: warp.load_components %{{.*}}[%[[K]]]

// A thread that is not a lane makes its own trips, and skips none.
// ALONE-LABEL: func.func @steps
// ALONE: %[[OWN:.*]] = warp.load_components
// ALONE-NOT: warp.most_trips
// ALONE: scf.for unsigned %{{.*}} = %{{.*}} to %[[OWN]]
// ALONE-NOT: scf.if
// ALONE: math.sin
func.func @steps(%n: !warp.array<1 x si32>, %x: !warp.array<1 x f32>,
                 %y: !warp.array<1 x f32>) attributes {warp.kernel} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %zero = warp.constant 0.0 : f32
  %i = warp.tid : si32
  %trips = warp.load %n[%i] : !warp.array<1 x si32>, si32 -> si32
  %own = warp.cast %trips : si32 to i32
  %most = warp.most_trips %own : i32
  %r = scf.for unsigned %k = %c0 to %most step %c1 iter_args(%s = %zero)
      -> (f32) : i32 {
    %made = arith.cmpi ult, %k, %own {warp.in_step} : i32
    %t = scf.if %made -> (f32) {
      %j = warp.cast %k : i32 to si32
      %v = warp.load %x[%j] : !warp.array<1 x f32>, si32 -> f32
      %w = warp.add(%s, %v) : (f32, f32) -> f32
      %u = warp.sin(%w) : (f32) -> f32
      scf.yield %u : f32
    } else {
      scf.yield %s : f32
    }
    scf.yield %t : f32
  }
  warp.store %r, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

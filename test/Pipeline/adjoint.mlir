// RUN: warp-opt %s --warp-emit=adjoint | FileCheck %s
// RUN: warp-opt %s --warp-emit=adjoint --warp-options=active=01 | FileCheck %s --check-prefix=SEED
// RUN: warp-opt %s --warp-emit=adjoint --warp-options=singular=report,unique=0 | FileCheck %s --check-prefix=REPORT
// RUN: warp-opt %s --warp-emit=tangent | FileCheck %s --check-prefix=TANGENT
// RUN: not warp-opt %s --warp-emit=adjoint --warp-options=active=1 2>&1 | FileCheck %s --check-prefix=FLAGS

// The adjoint takes the gradient of what was stored and adds to that of what
// was loaded; after the module come the facts for the runtime.
// CHECK-LABEL: func.func @root_adjoint
// CHECK: warp.load
// CHECK: warp.store
// CHECK: warp.accumulate {{.*}} {unique = 1 : i64}
// CHECK-NOT: warp.hidden
// CHECK: // needs array 0
// CHECK: // atomics 0

// Without a gradient for `x` only that of `y` is taken.
// SEED-LABEL: func.func @root_adjoint
// SEED-NOT: warp.accumulate
// SEED-NOT: needs array

// Threads may meet where arrays overlap; singular points are counted.
// REPORT-LABEL: func.func @root_adjoint
// REPORT-SAME: %{{.*}}: !warp.array<1 x si32>)
// REPORT: warp.accumulate
// REPORT-NOT: unique =
// REPORT: // hidden counters of array -1

// TANGENT-LABEL: func.func @root_tangent
// TANGENT: // hidden tangent of array 0
// TANGENT: // hidden tangent of array 1

// FLAGS: error: expects 2 flags for the arrays of the kernel, but got 1
module @root {
  func.func @root(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
      attributes {warp.arg_names = ["x", "y"], warp.kernel} {
    %i = warp.tid : si32
    %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
    %r = warp.sqrt(%v) : (f32) -> f32
    warp.store %r, %y[%i] : f32, !warp.array<1 x f32>, si32
    return
  }
}

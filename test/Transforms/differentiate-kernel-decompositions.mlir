// RUN: warp-opt %s --split-input-file \
// RUN:   --warp-differentiate-kernel=active=11 --canonicalize --cse | \
// RUN:   FileCheck %s

// The polar decomposition is differentiated by a linear system, not through the
// rotations that find it.
// CHECK-LABEL: func.func @polar_adjoint
// CHECK: %[[P:.*]]:2 = warp.polar
// CHECK-NOT: warp.sqrt
// CHECK: warp.solve3
// CHECK: warp.skew
// CHECK-NOT: warp.svd3
// CHECK: return
func.func @polar(%a: !warp.array<1 x !warp.mat<3x3 x f32>>,
                 %y: !warp.array<1 x !warp.mat<3x3 x f32>>) attributes
    {warp.arg_names = ["a", "y"], warp.kernel} {
  %i = warp.tid : si32
  %m = warp.load %a[%i]
      : !warp.array<1 x !warp.mat<3x3 x f32>>, si32 -> !warp.mat<3x3 x f32>
  %r, %s = warp.polar(%m) : (!warp.mat<3x3 x f32>)
      -> (!warp.mat<3x3 x f32>, !warp.mat<3x3 x f32>)
  warp.store %r, %y[%i]
      : !warp.mat<3x3 x f32>, !warp.array<1 x !warp.mat<3x3 x f32>>, si32
  return
}

// -----

// One system with the transposed matrix serves both operands.
// CHECK-LABEL: func.func @solve_adjoint
// CHECK: %[[T:.*]] = warp.transpose
// CHECK: %[[L:.*]] = warp.solve3(%[[T]]
// CHECK-NOT: warp.solve3(%[[T]]
// CHECK: warp.outer(%[[L]]
func.func @solve(%a: !warp.array<1 x !warp.mat<3x3 x f32>>,
                 %x: !warp.array<1 x !warp.vec<3 x f32>>) attributes
    {warp.arg_names = ["a", "x"], warp.kernel} {
  %i = warp.tid : si32
  %m = warp.load %a[%i]
      : !warp.array<1 x !warp.mat<3x3 x f32>>, si32 -> !warp.mat<3x3 x f32>
  %b = warp.get_diag(%m) : (!warp.mat<3x3 x f32>) -> !warp.vec<3 x f32>
  %s = warp.solve3(%m, %b) : (!warp.mat<3x3 x f32>, !warp.vec<3 x f32>)
      -> !warp.vec<3 x f32>
  warp.store %s, %x[%i]
      : !warp.vec<3 x f32>, !warp.array<1 x !warp.vec<3 x f32>>, si32
  return
}

// -----

// Only singular values get a cotangent: no quotient is left, so values may
// repeat.
// CHECK-LABEL: func.func @values_adjoint
// CHECK: warp.svd3
// CHECK-NOT: warp.div
// CHECK: return
func.func @values(%a: !warp.array<1 x !warp.mat<3x3 x f32>>,
                  %y: !warp.array<1 x !warp.vec<3 x f32>>) attributes
    {warp.arg_names = ["a", "y"], warp.kernel} {
  %i = warp.tid : si32
  %m = warp.load %a[%i]
      : !warp.array<1 x !warp.mat<3x3 x f32>>, si32 -> !warp.mat<3x3 x f32>
  %u, %s, %v = warp.svd3(%m) : (!warp.mat<3x3 x f32>)
      -> (!warp.mat<3x3 x f32>, !warp.vec<3 x f32>, !warp.mat<3x3 x f32>)
  warp.store %s, %y[%i]
      : !warp.vec<3 x f32>, !warp.array<1 x !warp.vec<3 x f32>>, si32
  return
}

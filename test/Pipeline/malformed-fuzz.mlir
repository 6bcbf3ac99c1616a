// Damaged kernels go through the whole pipeline, on both targets, without a
// crash: they are rejected with a message or compiled.

// RUN: %python %S/../Dialect/Inputs/mutate.py %s 300 1 | not warp-opt -split-input-file '--warp-pipeline=to-llvm debug' -o /dev/null
// RUN: %python %S/../Dialect/Inputs/mutate.py %s 300 2 | not warp-opt -split-input-file '--warp-pipeline=to-llvm target=sm_90' -o /dev/null

// The damaged input is a kernel that compiles.
// RUN: warp-opt %s --warp-pipeline=to-llvm -o /dev/null

func.func private @helper(%v: !warp.vec<3 x f32>, %i: si32) -> (f32, !warp.vec<3 x f32>) {
  %x = warp.extract %v[%i] : !warp.vec<3 x f32>, si32 -> f32
  %w = warp.insert %x, %v[%i] : f32, !warp.vec<3 x f32>, si32
  return %x, %w : f32, !warp.vec<3 x f32>
}
func.func @k(%c: i1, %v: !warp.vec<3 x f32>, %q: !warp.quat<f32>, %s: !warp.struct<"S", {x: f32, a: !warp.array<1 x f32>}>, %u: ui32, %o: !warp.array<1 x !warp.vec<3 x f32>>, %p: !warp.array<2 x ui32>, %m: !warp.mat<3x3 x f32>) attributes {warp.kernel} {
  %i, %j = warp.tid : si32, si32
  %c0 = warp.constant 0 : si32
  %c1 = warp.constant 1 : si32
  %x, %w = func.call @helper(%v, %c1) : (!warp.vec<3 x f32>, si32) -> (f32, !warp.vec<3 x f32>)
  %r = scf.if %c -> (!warp.vec<3 x f32>) { scf.yield %v : !warp.vec<3 x f32> } else { scf.yield %w : !warp.vec<3 x f32> }
  %lo = warp.cast %c0 : si32 to i32
  %hi = warp.cast %i : si32 to i32
  %st = warp.cast %c1 : si32 to i32
  %f = scf.for %k = %lo to %hi step %st iter_args(%acc = %x) -> (f32) : i32 {
    %k1 = warp.cast %k : i32 to si32
    %y = warp.cast %k1 : si32 to f32
    %z = warp.add(%acc, %y) : (f32, f32) -> f32
    scf.yield %z : f32
  }
  %g = warp.struct_get %s["a"] : !warp.struct<"S", {x: f32, a: !warp.array<1 x f32>}> -> !warp.array<1 x f32>
  warp.store %f, %g[%i] : f32, !warp.array<1 x f32>, si32
  %rot = warp.quat_rotate(%q, %r) : (!warp.quat<f32>, !warp.vec<3 x f32>) -> !warp.vec<3 x f32>
  %inv = warp.inverse(%m) : (!warp.mat<3x3 x f32>) -> !warp.mat<3x3 x f32>
  %mv = warp.mul(%inv, %rot) : (!warp.mat<3x3 x f32>, !warp.vec<3 x f32>) -> !warp.vec<3 x f32>
  %row = warp.extract %m[%i] : !warp.mat<3x3 x f32>, si32 -> !warp.vec<3 x f32>
  %m2 = warp.insert %row, %m[%c1] : !warp.vec<3 x f32>, !warp.mat<3x3 x f32>, si32
  %d = warp.determinant(%m2) : (!warp.mat<3x3 x f32>) -> f32
  %mv2 = warp.mul(%mv, %d) : (!warp.vec<3 x f32>, f32) -> !warp.vec<3 x f32>
  warp.store %mv2, %o[%i] : !warp.vec<3 x f32>, !warp.array<1 x !warp.vec<3 x f32>>, si32
  %pv = warp.view %p[%i] : !warp.array<2 x ui32>, si32 -> !warp.array<1 x ui32>
  %old = warp.atomic max %u, %pv[%j] : ui32, !warp.array<1 x ui32>, si32 -> ui32
  %rf, %u2 = warp.randf(%u) : (ui32) -> (f32, ui32)
  %cv = warp.component_view %o[%c1] : !warp.array<1 x !warp.vec<3 x f32>>, si32 -> !warp.array<1 x f32>
  warp.store %rf, %cv[%j] : f32, !warp.array<1 x f32>, si32
  %n = warp.dim %p, 1 : !warp.array<2 x ui32> -> si32
  %sl = warp.slice %p[%c0 : %n : %c1] dim 0 : !warp.array<2 x ui32>, si32, si32, si32
  warp.store %u2, %sl[%i, %j] : ui32, !warp.array<2 x ui32>, si32, si32
  warp.printf "%d %f\0A"(%i, %d) : si32, f32
  warp.assert %c, "no"
  return
}

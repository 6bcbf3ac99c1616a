// RUN: warp-opt %s --warp-flatten-structs --split-input-file | FileCheck %s

!P = !warp.struct<"P", {x: !warp.vec<3 x f32>, m: f32}>

// Elements of an array of structs are read and written field by field.
// CHECK-LABEL: func.func @elements
// CHECK: %[[X:.*]] = warp.component_view %arg0[] field "x"
// CHECK: %[[M:.*]] = warp.component_view %arg0[] field "m"
// CHECK: warp.load %[[X]]
// CHECK: %[[MASS:.*]] = warp.load %[[M]][%{{.*}}] : !warp.array<1 x f32>
// CHECK: %[[DOUBLE:.*]] = warp.add(%[[MASS]], %[[MASS]])
// CHECK: warp.store %{{.*}}, %{{.*}} : !warp.vec<3 x f32>
// CHECK: warp.store %[[DOUBLE]], %{{.*}} : f32
// CHECK-NOT: warp.struct_
func.func @elements(%a: !warp.array<1 x !P>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %p = warp.load %a[%i] : !warp.array<1 x !P>, si32 -> !P
  %m = warp.struct_get %p["m"] : !P -> f32
  %d = warp.add(%m, %m) : (f32, f32) -> f32
  %q = warp.struct_set %d, %p["m"] : f32, !P
  warp.store %q, %a[%i] : !P, !warp.array<1 x !P>, si32
  return
}

// -----

!In = !warp.struct<"In", {a: f32, b: f32}>
!Out = !warp.struct<"Out", {n: si32, in: !In}>

// Loops and branches carry fields; a struct within a struct is opened too. The
// argument stays and is read by warp.struct_get.
// CHECK-LABEL: func.func @carried
// CHECK-SAME: (%[[S:.*]]: !{{.*}}, %[[Y:.*]]: !warp.array<1 x f32>, %[[F:.*]]: i1)
// CHECK: %[[N:.*]] = warp.struct_get %[[S]]["n"]
// CHECK: %[[IN:.*]] = warp.struct_get %[[S]]["in"]
// CHECK: %[[A:.*]] = warp.struct_get %[[IN]]["a"]
// CHECK: %[[B:.*]] = warp.struct_get %[[IN]]["b"]
// CHECK: %[[L:.*]]:3 = scf.for {{.*}} iter_args(%{{.*}} = %[[N]], %[[CA:.*]] = %[[A]], %[[CB:.*]] = %[[B]]) -> (si32, f32, f32)
// CHECK: scf.yield %{{.*}}, %[[CB]], %[[CA]] : si32, f32, f32
// CHECK: %[[I:.*]]:3 = scf.if %[[F]] -> (si32, f32, f32)
// CHECK: %[[W:.*]] = warp.where(%[[F]], %[[I]]#2, %[[L]]#2)
// CHECK: warp.store %[[W]]
func.func @carried(%s: !Out, %y: !warp.array<1 x f32>, %f: i1)
    attributes {warp.kernel} {
  %c0 = arith.constant 0 : index
  %c4 = arith.constant 4 : index
  %c1 = arith.constant 1 : index
  %k = warp.constant 0 : si32
  %l = scf.for %i = %c0 to %c4 step %c1 iter_args(%t = %s) -> (!Out) {
    %in = warp.struct_get %t["in"] : !Out -> !In
    %a = warp.struct_get %in["a"] : !In -> f32
    %b = warp.struct_get %in["b"] : !In -> f32
    %swapped = warp.struct_create(%b, %a) : (f32, f32) -> !In
    %u = warp.struct_set %swapped, %t["in"] : !In, !Out
    scf.yield %u : !Out
  }
  %r = scf.if %f -> (!Out) {
    scf.yield %l : !Out
  } else {
    scf.yield %s : !Out
  }
  %w = warp.where(%f, %r, %l) : (i1, !Out, !Out) -> !Out
  %in = warp.struct_get %w["in"] : !Out -> !In
  %b = warp.struct_get %in["b"] : !In -> f32
  warp.store %b, %y[%k] : f32, !warp.array<1 x f32>, si32
  return
}

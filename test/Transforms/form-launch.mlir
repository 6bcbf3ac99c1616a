// RUN: warp-opt %s --split-input-file --warp-form-launch | FileCheck %s

#cpu = #warp.variant<target = <platform = cpu, bits = 256>, contiguous = 29>

// The body becomes a region of threads, their indices its arguments. What the
// launch promises of arguments stays with them: packed arrays, integers that
// are not negative, and names.
// CHECK-LABEL: func.func @line(
// CHECK-SAME: %[[A:[^:]+]]: !warp.array<1 x f32> {warp.name = "a", warp.packed}
// CHECK-SAME: %{{[^:]+}}: !warp.array<1 x f32> {warp.name = "b"}
// CHECK-SAME: %[[N:[^:]+]]: i32 {warp.name = "n", warp.non_negative}
// CHECK-SAME: %{{[^:]+}}: i1 {warp.name = "flag"}
// CHECK-NEXT: warp.group {
// CHECK-NEXT: warp.threads attributes {kinds = array<i32>, types = []} {
// CHECK-NEXT: ^bb0(%[[I:.*]]: i32):
// CHECK-NEXT: warp.store_components(%{{.*}}), %[[A]][%[[I]]]
// CHECK-NEXT: warp.yield
// CHECK-NEXT: }
// CHECK-NEXT: }
// CHECK-NEXT: return
func.func @line(%a: !warp.array<1 x f32>, %b: !warp.array<1 x f32>, %n: i32,
                %flag: i1, %s: f32)
    attributes {warp.kernel, warp.arg_names = ["a", "b", "n", "flag", "s"],
      warp.variant = #cpu} {
  %i = warp.tid : i32
  warp.store_components(%s), %a[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <platform = cpu, bits = 256>, rank = 2>

// A launch has as many indices as dimensions; others are 0, and wider ones are
// extended where they are asked for.
// CHECK-LABEL: func.func @plane(
// CHECK: ^bb0(%[[I:.*]]: i32, %[[J:.*]]: i32):
// CHECK: %[[ZERO:.*]] = arith.constant 0 : i32
// CHECK: warp.store_components({{.*}}), %{{.*}}[%[[I]], %[[J]], %[[ZERO]]]
// CHECK: %[[WIDE:.*]] = arith.extsi %[[J]] : i32 to i64
// CHECK: warp.store_components(%[[WIDE]]), %{{.*}}[%[[I]]]
// CHECK-NOT: warp.tid
func.func @plane(%a: !warp.array<3 x f32>, %b: !warp.array<1 x si64>, %s: f32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i, %j, %k = warp.tid : i32, i32, i32
  warp.store_components(%s), %a[%i, %j, %k]
    : (f32), !warp.array<3 x f32>, i32, i32, i32
  %i64, %j64 = warp.tid : i64, i64
  warp.store_components(%j64), %b[%i] : (i64), !warp.array<1 x si64>, i32
  return
}

// -----

#cpu = #warp.variant<target = <platform = cpu, bits = 256>, contiguous = 3>

// Arguments that were taken apart: facts are those of the whole, names of
// struct fields are paths, and an array in a struct is not promised packed.
// CHECK-LABEL: func.func @records(
// CHECK-SAME: f32 {warp.name = "v"}
// CHECK-SAME: f32 {warp.name = "v"}
// CHECK-SAME: !warp.array<1 x f32> {warp.name = "s.a"}
// CHECK-SAME: i64 {warp.name = "s.n"}
func.func @records(%x: f32, %y: f32, %a: !warp.array<1 x f32>, %n: i64)
    attributes {warp.kernel, warp.variant = #cpu,
      warp.arg_names = ["v", "s"], warp.arg_types = [!warp.vec<2 x f32>,
        !warp.struct<"S", {a: !warp.array<1 x f32>, n: si64}>]} {
  return
}

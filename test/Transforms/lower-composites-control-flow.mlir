// RUN: warp-opt %s --warp-lower-composites | FileCheck %s

!v2 = !warp.vec<2 x f32>

// The kernel's arguments are flattened; how they were is kept.
// CHECK-LABEL: func.func @kernel
// CHECK-SAME: (%{{.*}}: !warp.array<1 x f32>, %{{.*}}: f32, %{{.*}}: f32, %{{.*}}: i64)
// CHECK-SAME: warp.arg_types = [!warp.array<1 x f32>, !warp.vec<2 x f32>, ui64]
func.func @kernel(%a: !warp.array<1 x f32>, %v: !v2, %n: ui64)
    attributes {warp.kernel} {
  return
}

// Attributes of an argument go to each of its components.
// CHECK-LABEL: func.func @attributes
// CHECK-SAME: (%{{.*}}: f32 {warp.name = "v"}, %{{.*}}: f32 {warp.name = "v"}, %{{.*}}: i1)
func.func @attributes(%v: !v2 {warp.name = "v"}, %b: i1) {
  return
}

// Values that a loop carries are carried by component, those that it ignores
// are left as they were.
// CHECK-LABEL: func.func @loop
// CHECK-SAME: (%[[X:.*]]: f32, %[[Y:.*]]: f32, %[[N:.*]]: i32)
func.func @loop(%v: !v2, %n: si32) -> !v2 {
  %zero = arith.constant 0 : i32
  %one = arith.constant 1 : i32
  %to = warp.cast %n : si32 to i32
  // CHECK: %[[R:.*]]:2 = scf.for %{{.*}} = %{{.*}} to %[[N]] step %{{.*}} iter_args
  // CHECK-SAME: (%[[A:.*]] = %[[X]], %[[B:.*]] = %[[Y]]) -> (f32, f32)
  // CHECK: %[[C:.*]] = arith.addf %[[A]], %[[X]]
  // CHECK: %[[D:.*]] = arith.addf %[[B]], %[[Y]]
  // CHECK: scf.yield %[[C]], %[[D]]
  %r = scf.for %i = %zero to %to step %one iter_args(%sum = %v) -> (!v2) : i32 {
    %next = warp.add(%sum, %v) : (!v2, !v2) -> !v2
    scf.yield %next : !v2
  }
  // CHECK: return %[[R]]#0, %[[R]]#1
  return %r : !v2
}

// CHECK-LABEL: func.func @while
// CHECK-SAME: (%[[N:.*]]: i32)
func.func @while(%n: si32) -> si32 {
  // CHECK: scf.while (%[[I:.*]] = %[[N]]) : (i32) -> i32
  // CHECK: %[[GO:.*]] = arith.cmpi sgt, %[[I]]
  // CHECK: scf.condition(%[[GO]]) %[[I]] : i32
  // CHECK: ^bb0(%[[J:.*]]: i32):
  // CHECK: %[[K:.*]] = arith.subi %[[J]]
  // CHECK: scf.yield %[[K]] : i32
  %r = scf.while (%i = %n) : (si32) -> si32 {
    %zero = warp.constant 0 : si32
    %go = warp.gt(%i, %zero) : (si32, si32) -> i1
    scf.condition(%go) %i : si32
  } do {
  ^bb0(%j: si32):
    %one = warp.constant 1 : si32
    %k = warp.sub(%j, %one) : (si32, si32) -> si32
    scf.yield %k : si32
  }
  return %r : si32
}

// CHECK-LABEL: func.func @if
// CHECK-SAME: (%[[C:.*]]: i1, %[[X:.*]]: f32, %[[Y:.*]]: f32)
func.func @if(%c: i1, %v: !v2) -> !v2 {
  // CHECK: %[[R:.*]]:2 = scf.if %[[C]] -> (f32, f32)
  // CHECK: scf.yield %[[X]], %[[Y]]
  // CHECK: } else {
  // CHECK: arith.negf
  %r = scf.if %c -> (!v2) {
    scf.yield %v : !v2
  } else {
    %n = warp.neg(%v) : (!v2) -> !v2
    scf.yield %n : !v2
  }
  return %r : !v2
}

// A call passes and returns components.
// CHECK-LABEL: func.func private @callee
// CHECK-SAME: (f32, f32, i8) -> (f32, f32)
func.func private @callee(!v2, ui8) -> !v2

// CHECK-LABEL: func.func @caller
// CHECK-SAME: (%[[X:.*]]: f32, %[[Y:.*]]: f32, %[[B:.*]]: i8)
func.func @caller(%v: !v2, %b: ui8) -> !v2 {
  // CHECK: call @callee(%[[X]], %[[Y]], %[[B]]) : (f32, f32, i8) -> (f32, f32)
  %r = func.call @callee(%v, %b) : (!v2, ui8) -> !v2
  return %r : !v2
}

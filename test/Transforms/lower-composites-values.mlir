// RUN: warp-opt %s --warp-lower-composites | FileCheck %s

// Components are values of their own: construction and constant indices leave
// no operation behind, also from the end.
// CHECK-LABEL: func.func @construct_extract
// CHECK-SAME: (%[[X:.*]]: f32, %[[Y:.*]]: f32)
func.func @construct_extract(%x: f32, %y: f32) -> f32 {
  %v = warp.construct(%x, %y) : (f32, f32) -> !warp.vec<2 x f32>
  %last = warp.constant -1 : si32
  %r = warp.extract %v[%last] : !warp.vec<2 x f32>, si32 -> f32
  // CHECK: return %[[Y]]
  return %r : f32
}

// One scalar fills all components.
// CHECK-LABEL: func.func @splat
// CHECK-SAME: (%[[X:.*]]: f16)
func.func @splat(%x: f16) -> !warp.mat<2x1 x f16> {
  %m = warp.construct(%x) : (f16) -> !warp.mat<2x1 x f16>
  // CHECK: return %[[X]], %[[X]] : f16, f16
  return %m : !warp.mat<2x1 x f16>
}

// A row replaces its components and no others.
// CHECK-LABEL: func.func @insert_row
// CHECK-SAME: (%[[A:.*]]: f32, %[[B:.*]]: f32, %{{.*}}: f32, %{{.*}}: f32, %[[R0:.*]]: f32, %[[R1:.*]]: f32)
func.func @insert_row(%m: !warp.mat<2x2 x f32>, %row: !warp.vec<2 x f32>)
    -> !warp.mat<2x2 x f32> {
  %i = warp.constant 1 : ui32
  %r = warp.insert %row, %m[%i] : !warp.vec<2 x f32>, !warp.mat<2x2 x f32>, ui32
  // CHECK: return %[[A]], %[[B]], %[[R0]], %[[R1]]
  return %r : !warp.mat<2x2 x f32>
}

// An index known at run time selects; a negative one counts from the end.
// CHECK-LABEL: func.func @dynamic_extract
// CHECK-SAME: (%[[X:.*]]: f32, %[[Y:.*]]: f32, %[[I:.*]]: i32)
func.func @dynamic_extract(%v: !warp.vec<2 x f32>, %i: si32) -> f32 {
  // CHECK: %[[NEGATIVE:.*]] = arith.cmpi slt, %[[I]]
  // CHECK: %[[WRAPPED:.*]] = arith.addi %[[I]]
  // CHECK: %[[AT:.*]] = arith.select %[[NEGATIVE]], %[[WRAPPED]], %[[I]]
  // CHECK: %[[ODD:.*]] = arith.cmpi ne
  // CHECK: %[[R:.*]] = arith.select %[[ODD]], %[[Y]], %[[X]]
  // CHECK: return %[[R]]
  %r = warp.extract %v[%i] : !warp.vec<2 x f32>, si32 -> f32
  return %r : f32
}

// CHECK-LABEL: func.func @dynamic_insert
// CHECK-SAME: (%[[X:.*]]: f32, %[[Y:.*]]: f32, %[[I:.*]]: i32, %[[S:.*]]: f32)
func.func @dynamic_insert(%v: !warp.vec<2 x f32>, %i: ui32, %s: f32)
    -> !warp.vec<2 x f32> {
  // CHECK: %[[FIRST:.*]] = arith.cmpi eq, %[[I]], %{{.*}}
  // CHECK: %[[R0:.*]] = arith.select %[[FIRST]], %[[S]], %[[X]]
  // CHECK: %[[SECOND:.*]] = arith.cmpi eq, %[[I]], %{{.*}}
  // CHECK: %[[R1:.*]] = arith.select %[[SECOND]], %[[S]], %[[Y]]
  // CHECK: return %[[R0]], %[[R1]]
  %r = warp.insert %s, %v[%i] : f32, !warp.vec<2 x f32>, ui32
  return %r : !warp.vec<2 x f32>
}

!pair = !warp.struct<"Pair", {p: !warp.vec<2 x f32>, a: !warp.array<1 x f32>}>

// Fields of a struct are ranges of its components; an array stays one value.
// CHECK-LABEL: func.func @fields
// CHECK-SAME: (%[[X:.*]]: f32, %[[Y:.*]]: f32, %[[A:.*]]: !warp.array<1 x f32>, %[[S:.*]]: f32)
func.func @fields(%pair: !pair, %s: f32)
    -> (!warp.array<1 x f32>, !warp.vec<2 x f32>) {
  %v = warp.construct(%s) : (f32) -> !warp.vec<2 x f32>
  %set = warp.struct_set %v, %pair["p"] : !warp.vec<2 x f32>, !pair
  %a = warp.struct_get %set["a"] : !pair -> !warp.array<1 x f32>
  %p = warp.struct_get %set["p"] : !pair -> !warp.vec<2 x f32>
  // CHECK: return %[[A]], %[[S]], %[[S]]
  return %a, %p : !warp.array<1 x f32>, !warp.vec<2 x f32>
}

// The bits of several components make up a wider one, the first lowest.
// CHECK-LABEL: func.func @bits
// CHECK-SAME: (%[[X:.*]]: f32, %[[Y:.*]]: f32)
func.func @bits(%v: !warp.vec<2 x f32>) -> ui64 {
  // CHECK-DAG: %[[LOW:.*]] = arith.bitcast %[[X]] : f32 to i32
  // CHECK-DAG: %[[HIGH:.*]] = arith.bitcast %[[Y]] : f32 to i32
  // CHECK: %[[LOW64:.*]] = arith.extui %[[LOW]]
  // CHECK: %[[HIGH64:.*]] = arith.extui %[[HIGH]]
  // CHECK: %[[SHIFTED:.*]] = arith.shli %[[HIGH64]]
  // CHECK: arith.ori %[[LOW64]], %[[SHIFTED]] : i64
  %r = warp.bitcast %v : !warp.vec<2 x f32> to ui64
  return %r : ui64
}

// A choice between equal components needs no select.
// CHECK-LABEL: func.func @where
// CHECK-SAME: (%[[C:.*]]: i32, %[[X:.*]]: f32, %[[Y:.*]]: f32)
func.func @where(%c: si32, %x: f32, %y: f32) -> !warp.vec<2 x f32> {
  %a = warp.construct(%x, %y) : (f32, f32) -> !warp.vec<2 x f32>
  %b = warp.construct(%x, %x) : (f32, f32) -> !warp.vec<2 x f32>
  // CHECK: %[[HOLDS:.*]] = arith.cmpi ne, %[[C]]
  // CHECK: %[[R:.*]] = arith.select %[[HOLDS]], %[[Y]], %[[X]]
  // CHECK: return %[[X]], %[[R]]
  %r = warp.where(%c, %a, %b)
    : (si32, !warp.vec<2 x f32>, !warp.vec<2 x f32>) -> !warp.vec<2 x f32>
  return %r : !warp.vec<2 x f32>
}

// RUN: warp-opt %s --canonicalize | FileCheck %s

// Floats saturate; NaN becomes zero.
// CHECK-LABEL: func.func @float_to_integer
// CHECK-DAG: %[[MAX:.*]] = warp.constant 127 : si8
// CHECK-DAG: %[[MIN:.*]] = warp.constant -128 : si8
// CHECK-DAG: %[[ZERO:.*]] = warp.constant 0 : si8
// CHECK-DAG: %[[UZERO:.*]] = warp.constant 0 : ui32
// CHECK-DAG: %[[TRUNC:.*]] = warp.constant -1 : si8
// CHECK: return %[[MAX]], %[[MIN]], %[[ZERO]], %[[UZERO]], %[[TRUNC]]
func.func @float_to_integer() -> (si8, si8, si8, ui32, si8) {
  %a = warp.constant 1.0e9 : f32
  %b = warp.constant 0xFF800000 : f32
  %c = warp.constant 0x7FC00000 : f32
  %d = warp.constant -1.9 : f32
  %0 = warp.cast %a : f32 to si8
  %1 = warp.cast %b : f32 to si8
  %2 = warp.cast %c : f32 to si8
  %3 = warp.cast %d : f32 to ui32
  %4 = warp.cast %d : f32 to si8
  return %0, %1, %2, %3, %4 : si8, si8, si8, ui32, si8
}

// CHECK-LABEL: func.func @integer_to_float
// CHECK-DAG: %[[BIG:.*]] = warp.constant 4.2949673E+9 : f32
// CHECK-DAG: %[[NEG:.*]] = warp.constant -1.000000e+00 : f32
// CHECK-DAG: %[[EVEN:.*]] = warp.constant 0x4B800000 : f32
// CHECK-DAG: %[[TRUE:.*]] = warp.constant 1.000000e+00 : f32
// CHECK: return %[[BIG]], %[[NEG]], %[[EVEN]], %[[TRUE]]
func.func @integer_to_float() -> (f32, f32, f32, f32) {
  %a = warp.constant 4294967295 : ui32
  %b = warp.constant -1 : si32
  %c = warp.constant 16777217 : si32
  %d = warp.constant true
  %0 = warp.cast %a : ui32 to f32
  %1 = warp.cast %b : si32 to f32
  %2 = warp.cast %c : si32 to f32
  %3 = warp.cast %d : i1 to f32
  return %0, %1, %2, %3 : f32, f32, f32, f32
}

// Integers are extended by their own sign and truncated.
// CHECK-LABEL: func.func @integers
// CHECK-DAG: %[[A:.*]] = warp.constant 18446744073709551615 : ui64
// CHECK-DAG: %[[B:.*]] = warp.constant 255 : si32
// CHECK-DAG: %[[C:.*]] = warp.constant -1 : si8
// CHECK: return %[[A]], %[[B]], %[[C]]
func.func @integers() -> (ui64, si32, si8) {
  %a = warp.constant -1 : si8
  %b = warp.constant 255 : ui8
  %0 = warp.cast %a : si8 to ui64
  %1 = warp.cast %b : ui8 to si32
  %2 = warp.cast %b : ui8 to si8
  return %0, %1, %2 : ui64, si32, si8
}

// A boolean is whether the number is not zero; -0 is zero, NaN is not.
// CHECK-LABEL: func.func @booleans
// CHECK-DAG: %[[TRUE:.*]] = warp.constant true
// CHECK-DAG: %[[FALSE:.*]] = warp.constant false
// CHECK: return %[[TRUE]], %[[FALSE]], %[[TRUE]]
func.func @booleans() -> (i1, i1, i1) {
  %a = warp.constant 256 : si32
  %b = warp.constant -0.0 : f32
  %c = warp.constant 0x7FC00000 : f32
  %0 = warp.cast %a : si32 to i1
  %1 = warp.cast %b : f32 to i1
  %2 = warp.cast %c : f32 to i1
  return %0, %1, %2 : i1, i1, i1
}

// There and back through a type that holds every value.
// CHECK-LABEL: func.func @round_trips(
// CHECK-SAME: %[[I:.*]]: si32, %[[J:.*]]: i32, %[[V:.*]]: !warp.vec<3 x f32>)
// CHECK: %[[N:.*]] = warp.cast %[[I]] : si32 to si8
// CHECK: %[[W:.*]] = warp.cast %[[N]] : si8 to si32
// CHECK: return %[[I]], %[[J]], %[[V]], %[[W]]
func.func @round_trips(%i: si32, %j: i32, %v: !warp.vec<3 x f32>) -> (si32, i32, !warp.vec<3 x f32>, si32) {
  %0 = warp.cast %i : si32 to ui64
  %1 = warp.cast %0 : ui64 to si32
  %2 = warp.cast %j : i32 to si32
  %3 = warp.cast %2 : si32 to i32
  %4 = warp.cast %v : !warp.vec<3 x f32> to !warp.vec<3 x f32>
  %5 = warp.cast %i : si32 to si8
  %6 = warp.cast %5 : si8 to si32
  return %1, %3, %4, %6 : si32, i32, !warp.vec<3 x f32>, si32
}

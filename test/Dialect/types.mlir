// RUN: warp-opt %s | warp-opt | FileCheck %s

// Every scalar type is printed as it was read.
// CHECK-DAG: !Empty = !warp.struct<"Empty", {}>
// CHECK-DAG: !P_22q22 = !warp.struct<"a.<locals>.P \22q\22", {"two words": i1, x: !warp.vec<3 x f32>}>
// CHECK-DAG: !Outer = !warp.struct<"Outer", {inner: !S, data: !warp.array<1 x f32>}>

// CHECK-LABEL: func.func private @scalars(
// CHECK-SAME: i1, si8, ui8, si16, ui16, si32, ui32, si64, ui64, f16, bf16, f32, f64)
func.func private @scalars(i1, si8, ui8, si16, ui16, si32, ui32, si64, ui64,
                           f16, bf16, f32, f64)

// Composites take any scalar; quaternions and transforms take floats.
// CHECK-LABEL: func.func private @composites(
// CHECK-SAME: !warp.vec<1 x i1>, !warp.vec<3 x f32>, !warp.vec<65536 x ui8>
// CHECK-SAME: !warp.mat<1x1 x f16>, !warp.mat<2x3 x si64>, !warp.mat<256x256 x f64>
// CHECK-SAME: !warp.quat<f32>, !warp.quat<bf16>, !warp.transform<f64>)
func.func private @composites(
    !warp.vec<1 x i1>, !warp.vec<3 x f32>, !warp.vec<65536 x ui8>,
    !warp.mat<1x1 x f16>, !warp.mat<2 x 3 x si64>, !warp.mat<256x256 x f64>,
    !warp.quat<f32>, !warp.quat<bf16>, !warp.transform<f64>)

// Arrays hold scalars, composites and structs.
// CHECK-LABEL: func.func private @arrays(
// CHECK-SAME: !warp.array<1 x f32>, !warp.array<4 x !warp.mat<3x3 x f32>>
// CHECK-SAME: !warp.array<2 x !S>)
func.func private @arrays(
    !warp.array<1 x f32>, !warp.array<4 x !warp.mat<3x3 x f32>>,
    !warp.array<2 x !warp.struct<"S", {x: f32}>>)

// Structs nest, hold arrays, and may be empty; odd names are quoted. A struct
// is printed once and then goes by its name.
// CHECK-LABEL: func.func private @structs(
// CHECK-SAME: !Empty, !P_22q22, !Outer, !S)
func.func private @structs(
    !warp.struct<"Empty", {}>,
    !warp.struct<"a.<locals>.P \"q\"", {"two words": i1, x: !warp.vec<3 x f32>}>,
    !warp.struct<"Outer", {inner: !warp.struct<"S", {x: f32}>,
                           data: !warp.array<1 x f32>}>,
    !warp.struct<"S", {x: f32}>)

// Two structs of one name stay apart.
// CHECK-LABEL: func.func private @same_names(
// CHECK-SAME: !S1, !S)
func.func private @same_names(!warp.struct<"S", {x: f64}>, !warp.struct<"S", {x: f32}>)

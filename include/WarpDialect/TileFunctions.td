//===- TileFunctions.td - Device functions of tiles ----------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Functions of cpu/Tile*.cpp, gpu/Tile*.cpp and nvidia/Tile*.cpp. A step is the
// number of elements to the next row or column.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TILE_FUNCTIONS_TD
#define WARP_TILE_FUNCTIONS_TD

include "FunctionBase.td"

//===----------------------------------------------------------------------===//
// On CPUs
//===----------------------------------------------------------------------===//

foreach f = ["f32", "f64"] in {
/// c = alpha a b + beta c; `fresh`: c is new.
def : TileFunction<"product_" # f,
    "(c: address, a: address, b: address, rows: i32, columns: i32, depth: i32, "
    "row_step_a: i32, column_step_a: i32, row_step_b: i32, fresh: i32, "
    "alpha: " # f # ", beta: " # f # ") -> ()">;
/// The transposed matrix.
def : TileFunction<"transpose_" # f,
    "(out: address, matrix: address, rows: i32, columns: i32, step: i32) -> "
    "()">;
def : TileFunction<"cholesky_" # f,
    "(out: address, matrix: address, scratch: address, rows: i32, "
    "upper: i32) -> ()">;
/// The cotangent of the factor becomes that of the matrix.
def : TileFunction<"cholesky_adjoint_" # f,
    "(cotangent: address, factor: address, scratch: address, row_step: i32, "
    "column_step: i32, rows: i32, upper: i32) -> ()">;
/// `backward`: the last row is solved first.
def : TileFunction<"solve_" # f,
    "(right_sides: address, matrix: address, rows: i32, columns: i32, "
    "row_step: i32, column_step: i32, backward: i32) -> ()">;
/// For the systems of several blocks, `bytes` apart.
def : TileFunction<"systems_" # f,
    "(factor: address, matrix: address, right_sides: address, "
    "scratch: address, bytes: i32, blocks: i32, rows: i32, columns: i32, "
    "task: i32) -> ()">;
def : TileFunction<"systems_adjoint_" # f,
    "(cotangent: address, factor: address, scratch: address, bytes: i32, "
    "blocks: i32, rows: i32, upper: i32) -> ()">;
def : TileFunction<"fft_" # f,
    "(out: address, operand: address, scratch: address, rows: i32, "
    "length: i32, inverse: i32) -> ()">;
}
def : TileFunction<"sort",
    "(keys: address, positions: address, count: i32) -> ()">;

//===----------------------------------------------------------------------===//
// For threads of a GPU block, by element type or layout
//===----------------------------------------------------------------------===//

/// From an array to shared memory; `tested` against the extents.
def : TileFunction<"fetch_*",
    "(to: address, data: address, offset0: i32, offset1: i32, extent0: i32, "
    "extent1: i32, step0: i32, step1: i32, rows: i32, columns: i32, "
    "tested: i32, row_step: i32, threads: i32) -> ()", [AssembledProductShort]>;
def : TileFunction<"close_group", "() -> ()", [AssembledProductShort]>;
/// Groups that need not be there.
def : TileFunction<"await_groups", "(groups: i32) -> ()",
    [AssembledProductShort]>;
/// The address of the tensor map of an array, by its offset among the
/// parameters.
def : TileFunction<"map", "(offset: i32) -> u64", [Expanded]>;
def : TileFunction<"publish_copies", "() -> ()", [AssembledProductShort]>;
def : TileFunction<"await_products", "() -> ()", [AssembledProductShort]>;

/// Register accumulators, and a number for all.
def : TileFunction<"set_f64_*", "(sums: address, value: f64) -> ()",
    [AssembledProduct]>;
def : TileFunction<"set_*", "(sums: address, value: f32) -> ()",
    [AssembledProduct]>;
/// From and to shared memory.
def : TileFunction<"take_*",
    "(sums: address, memory: address, rows: i32, columns: i32) -> ()",
    [AssembledProduct]>;
def : TileFunction<"give_*",
    "(sums: address, memory: address, rows: i32, columns: i32) -> ()",
    [AssembledProduct]>;
/// To an array.
class AccumulatorStore<string name> : TileFunction<name,
    "(sums: address, data: address, offset0: i32, offset1: i32, extent0: i32, "
    "extent1: i32, step0: i32, step1: i32, rows: i32, columns: i32, "
    "tested: i32) -> ()", [AssembledProduct]>;
def : AccumulatorStore<"store_*">;
def : AccumulatorStore<"add_*">;
/// A reduction of a number of each thread, and of `arg` ones its position.
def : TileFunction<"combine_*",
    "(value: address, scratch: address, threads: i32) -> ()">;
def : TileFunction<"factor_*",
    "(out: address, row_step: i32, column_step: i32, operand: address, "
    "operand_row_step: i32, operand_column_step: i32, scratch: address, "
    "rows: i32, threads: i32) -> ()", [Assembled]>;
def : TileFunction<"differentiate_factor_*",
    "(cotangent: address, row_step: i32, column_step: i32, factor: address, "
    "factor_row_step: i32, factor_column_step: i32, scratch: address, "
    "rows: i32, threads: i32) -> ()", [Assembled]>;
foreach f = ["substitute_*", "solve_columns_*"] in
def : TileFunction<f,
    "(right_sides: address, matrix: address, row_step: i32, column_step: i32, "
    "rows: i32, columns: i32, backward: i32, threads: i32) -> ()",
    [Assembled]>;
def : TileFunction<"transform_*",
    "(tile: address, scratch: address, rows: i32, length: i32, inverse: i32, "
    "threads: i32) -> ()", [Assembled]>;
/// `subtracts`: the product is taken from the sums.
def : TileFunction<"multiply_*",
    "(sums: address, a: address, b: address, rows: i32, columns: i32, "
    "depth: i32, row_step_a: i32, row_step_b: i32, subtracts: i32) -> ()",
    [AssembledProduct]>;
/// Multi-buffered products. For either factor: place, tensor map, first row and
/// column, steps of both, columns of a TMA tile.
def : TileFunction<"stream_*",
    "(sums: address, barriers: address, stages: i32, steps: i32, a: address, "
    "map_a: address, row_a: i32, column_a: i32, row_step_a: i32, "
    "column_step_a: i32, columns_a: i32, b: address, map_b: address, "
    "row_b: i32, column_b: i32, row_step_b: i32, column_step_b: i32, "
    "columns_b: i32, rows: i32, columns: i32, depth: i32, pitch_a: i32, "
    "pitch_b: i32, consumers: i32, threads: i32) -> ()", [AssembledProduct]>;

//===----------------------------------------------------------------------===//
// For any block, without scratch memory (lib/DeviceLib/tiles)
//===----------------------------------------------------------------------===//

def : TileFunction<"block_factor_*",
    "(out: address, row_step: i32, column_step: i32, operand: address, "
    "operand_row_step: i32, operand_column_step: i32, rows: i32, "
    "threads: i32) -> ()">;
def : TileFunction<"block_solve_*",
    "(right_sides: address, matrix: address, row_step: i32, column_step: i32, "
    "rows: i32, columns: i32, backward: i32, threads: i32) -> ()">;

#endif // WARP_TILE_FUNCTIONS_TD

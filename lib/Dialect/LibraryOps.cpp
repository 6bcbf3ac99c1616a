//===- LibraryOps.cpp - Calls of the device library -----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The table says what lib/DeviceLib defines: for geometry in the files of the
// folder itself, and for tiles in cpu/Tile*.cpp and gpu/Tile*.cpp. A star
// stands for several endings.
//
//===----------------------------------------------------------------------===//

#include "WarpDialect/LibraryOps.h"
#include "WarpDialect/WarpDialect.h"
#include "warp/NativeCode.h"

using namespace mlir;

static constexpr warp::LibraryFunction functions[] = {
    // Number, bytes: the address of memory that each thread has for itself.
    {warp::threadMemory, "ii", "l"},
    {warp::isDifferentiated, "", "i"},
    // A handle and a kind: the address of its slot, or of one with nothing.
    {"warp_slot", "li", "l"},
    // A point and the largest distance: face, weights of two corners.
    {"warp_mesh_closest", "lffff", "iff", 48},
    {"warp_mesh_furthest", "lffff", "iff", 80},
    // The same and where corners are one: also the side by normals.
    {"warp_mesh_closest_signed", "lfffff", "ifff", 80},
    // A point: -1 inside, 1 outside.
    {"warp_mesh_side", "lfff", "f", 80},
    // Start, direction, largest parameter, root: face, weights, parameter.
    {"warp_mesh_ray", "lfffffffi", "ifff", 64},
    {"warp_mesh_ray_any", "lfffffffi", "i", 64},
    // Start, direction, root: how often the ray crosses the surface.
    {"warp_mesh_ray_count", "lffffffi", "i", 80},
    // A point; rays and how they spread, or accuracy and threshold: its side.
    {"warp_mesh_side_parity", "lfffif", "f", 80},
    {"warp_mesh_side_winding", "lfffff", "f", 80},
    // The number of a group: the node that holds it, or -1.
    {"warp_group_root", "li", "i"},
    // Shape, its seven numbers and its limit, cursor: primitive, cursor.
    {"warp_overlap_next", "liffffffffiiiill", "iiiiill"},
    // Shape, its seven numbers, which of how many threads: its cursor.
    {"warp_overlap_share", "lifffffffii", "iiiill"},
    // A voxel: the place of its value (geometry/Volume.h). Type of values and a
    // voxel: the places of the corners of a cell, z fastest, in a grid of that
    // type; the address of a leaf's value or 0.
    {"warp_volume_voxel", "liii", "l", 0, 1},
    {"warp_volume_cell", "liiii", "llllllll", 0, 2},
    {"warp_volume_place", "liiii", "l"},
    // A voxel: its number or -1; the same of the corners of a cell.
    {"warp_volume_index", "liii", "i", 0, 1},
    {"warp_volume_cell_index", "liii", "iiiiiiii", 0, 1},
    // Cells per unit of length, the grid's cells; a point and a distance: first
    // cell and how many along each axis.
    {"warp_grid_cells_f32", "fiiiffff", "iiiiii", 0, 4},
    {"warp_grid_cells_f64", "diiidddd", "iiiiii", 0, 4},
    // Three points of a plane, four points of space: which way they turn.
    {"warp_orient2d", "dddddd", "i"},
    {"warp_orient3d", "dddddddddddd", "i"},
    // c, a, b; rows, columns, depth; steps to the next row and column of a and
    // the next row of b; whether c is new; alpha, beta.
    {"warp_tile_product_f32", "llliiiiiiiff", ""},
    {"warp_tile_product_f64", "llliiiiiiidd", ""},
    // Result, matrix; its rows and columns, and elements per row.
    {"warp_tile_turn_f32", "lliii", ""},
    {"warp_tile_turn_f64", "lliii", ""},
    // Result, matrix, scratch memory; rows, whether the upper triangle counts.
    {"warp_tile_cholesky_f32", "lllii", ""},
    {"warp_tile_cholesky_f64", "lllii", ""},
    // Cotangent, which becomes the matrix's, factor, scratch memory; steps to
    // the next row and column of the factor, rows, whether the upper triangle
    // counts.
    {"warp_tile_cholesky_adjoint_f32", "llliiii", ""},
    {"warp_tile_cholesky_adjoint_f64", "llliiii", ""},
    // Right sides, matrix; their rows and columns; steps to the next row and
    // column of the matrix; whether the last row is solved first.
    {"warp_tile_solve_f32", "lliiiii", ""},
    {"warp_tile_solve_f64", "lliiiii", ""},
    // Of several blocks: factor, matrix, right sides of the first one, scratch
    // memory; bytes from block to block, blocks, rows, columns of right sides,
    // what is to be done.
    {"warp_tile_systems_f32", "lllliiiii", ""},
    {"warp_tile_systems_f64", "lllliiiii", ""},
    // The same of cotangents of factors, which become those of the matrices.
    {"warp_tile_systems_adjoint_f32", "llliiii", ""},
    {"warp_tile_systems_adjoint_f64", "llliiii", ""},
    // Result, operand, scratch memory; rows, their length, whether inverse.
    {"warp_tile_fft_f32", "llliii", ""},
    {"warp_tile_fft_f64", "llliii", ""},
    // Keys, positions, how many.
    {"warp_tile_sort", "lli", ""},
    // The same for threads of a GPU's block, by element type or layout. From an
    // array to the block's memory: place, data, offsets, extents, steps, shape,
    // whether it is tested against the extents; elements per row there,
    // threads.
    {"warp_tile_fetch_*", "lliiiiiiiiiii", ""},
    {"warp_tile_close_group", "", ""},
    // Groups that need not be there.
    {"warp_tile_await_groups", "i", ""},
    // Where the map of an array lies among the parameters: its address.
    {"warp_tile_map", "i", "l"},
    {"warp_tile_publish_copies", "", ""},
    {"warp_tile_await_products", "", ""},
    // Sums and a number.
    {"warp_tile_set_f64_*", "ld", ""},
    {"warp_tile_set_*", "lf", ""},
    // Sums, memory; rows and columns.
    {"warp_tile_take_*", "llii", ""},
    {"warp_tile_give_*", "llii", ""},
    // Sums, data, offsets, extents, steps, shape, whether it is tested.
    {"warp_tile_store_*", "lliiiiiiiii", ""},
    {"warp_tile_add_*", "lliiiiiiiii", ""},
    // A number of each thread, and of `arg` ones its position; scratch memory,
    // threads.
    {"warp_tile_combine_*", "lli", ""},
    // Result and operand with elements from row to row and column to column;
    // scratch memory, rows, threads.
    {"warp_tile_factor_*", "liiliilii", ""},
    // Cotangent and factor likewise.
    {"warp_tile_differentiate_factor_*", "liiliilii", ""},
    // The same for any block, without scratch memory.
    {"warp_tile_block_factor_*", "liiliiii", ""},
    {"warp_tile_block_solve_*", "lliiiiii", ""},
    // Right sides, matrix with such steps, its rows, columns of right sides,
    // whether the last row is solved first, threads.
    {"warp_tile_substitute_*", "lliiiiii", ""},
    // Tile, scratch memory, rows, their length, whether inverse, threads.
    {"warp_tile_transform_*", "lliiii", ""},
    // Sums, factors; rows, columns, depth; elements per row of the factors.
    {"warp_tile_multiply_*", "llliiiii", ""},
    // Sums, barriers of a ring, its places, steps; of either factor place, map,
    // first row and column, steps of both, columns of a box; the same numbers;
    // threads that have sums, threads.
    {"warp_tile_stream_*", "lliilliiiiilliiiiiiiiiiii", ""},
};

const warp::LibraryFunction *warp::findLibraryFunction(StringRef symbol) {
  if (symbol.consume_back(lanesSuffix)) {
    const LibraryFunction *function = findLibraryFunction(symbol);
    return function && function->shared >= 0 ? function : nullptr;
  }
  for (const LibraryFunction &function : functions)
    if (function.symbol.ends_with("*")
            ? symbol.starts_with(function.symbol.drop_back())
            : function.symbol == symbol)
      return &function;
  return nullptr;
}

mlir::Type warp::getLibraryType(MLIRContext *context, char letter) {
  if (letter == 'f')
    return Float32Type::get(context);
  if (letter == 'd')
    return Float64Type::get(context);
  return letter == 'i' ? IntegerType::get(context, 32, IntegerType::Signed)
                       : IntegerType::get(context, 64, IntegerType::Unsigned);
}

/// With and without a sign, as the phases have it. A thread's memory is an
/// address. All but the first `shared` are vectors.
static bool fits(TypeRange types, StringRef letters, size_t shared) {
  if (types.size() != letters.size())
    return false;
  for (auto [i, type, letter] : llvm::enumerate(types, letters)) {
    bool isVector = isa<VectorType>(type);
    Type scalar = isVector ? getElementTypeOrSelf(type) : type;
    if (isVector != (i >= shared))
      return false;
    if (!(letter == 'l' && isa<warp::ScratchType>(scalar)) &&
        warp::getSignless(scalar) !=
            warp::getSignless(warp::getLibraryType(type.getContext(), letter)))
      return false;
  }
  return true;
}

LogicalResult warp::LibraryCallOp::verify() {
  if (getCallee().starts_with(nativeCodePrefix)) {
    auto isScalar = [](mlir::Type type) { return type.isIntOrFloat(); };
    if (getNumResults() != 0 && llvm::all_of(getOperandTypes(), isScalar) &&
        llvm::all_of(getResultTypes(), isScalar))
      return success();
    return emitOpError("(C3) native code takes and gives scalars");
  }
  const LibraryFunction *function = findLibraryFunction(getCallee());
  if (!function)
    return emitOpError("(C1) the device library has no function '")
           << getCallee() << "'";
  bool isLanes = getCallee().ends_with(lanesSuffix);
  size_t shared = isLanes ? size_t(function->shared) : SIZE_MAX;
  if (!fits(getArgs().getTypes(), function->operands, shared) ||
      !fits(getResults().getTypes(), function->results, isLanes ? 0 : shared))
    return emitOpError("(C2) '")
           << getCallee() << "' takes '" << function->operands
           << "' and gives '" << function->results << "'";
  return success();
}

void warp::LibraryCallOp::getEffects(
    SmallVectorImpl<MemoryEffects::EffectInstance> &effects) {
  if (getNumResults() != 0 && !getCallee().starts_with(nativeMemoryPrefix))
    return;
  effects.emplace_back(MemoryEffects::Read::get());
  effects.emplace_back(MemoryEffects::Write::get());
}

#define GET_OP_CLASSES
#include "WarpDialect/WarpLibraryOps.cpp.inc"

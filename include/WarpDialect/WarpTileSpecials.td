//===- WarpTileSpecials.td - Builtins for tiles --------------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// What users read about them; the front end makes operations of
// WarpTileOps.td of them.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TILE_SPECIALS_TD
#define WARP_TILE_SPECIALS_TD

include "WarpBuiltinBase.td"

class Warp_TileSpecial<string name, list<string> overloads, string summaryOf>
    : Warp_Special<name, "Tiles", overloads, summaryOf>;

def Warp_BlockDimName : Warp_TileSpecial<"block_dim",
    ["() -> int"],
     "number of threads of a block; 1 on a CPU">;
def Warp_TileName : Warp_TileSpecial<"tile",
    ["(x: Any, preserve_type: Any = False) -> Any"],
     "tile of what each thread of the block has; vectors become columns "
     "unless `preserve_type`">;
def Warp_UntileName : Warp_TileSpecial<"untile",
    ["(a: Any) -> Any"],
     "what this thread has of a tile that `tile` could have made">;
def Warp_TileFromThreadName : Warp_TileSpecial<"tile_from_thread",
    ["(shape: Any, value: Any, thread_idx: int, storage: str = "
     "\"register\") -> Any"],
     "the value of one thread in all elements">;
def Warp_TileZerosName : Warp_TileSpecial<"tile_zeros",
    ["(shape: Any, dtype: Any = float, storage: str = \"register\") -> Any"],
     "tile of zeros">;
def Warp_TileOnesName : Warp_TileSpecial<"tile_ones",
    ["(shape: Any, dtype: Any = float, storage: str = \"register\") -> Any"],
     "tile of ones">;
def Warp_TileEmptyName : Warp_TileSpecial<"tile_empty",
    ["(shape: Any, dtype: Any = float, storage: str = \"register\") -> Any"],
     "tile of unspecified elements">;
def Warp_TileFullName : Warp_TileSpecial<"tile_full",
    ["(shape: Any, value: Any, dtype: Any = None, storage: str = "
     "\"register\") -> Any"],
     "tile with a value in all elements">;
def Warp_TileArangeName : Warp_TileSpecial<"tile_arange",
    ["(*args: Any, dtype: Any = None, storage: str = \"register\") -> Any"],
     "tile of start, start + step, ... before stop, from constants">;
def Warp_TileRandiName : Warp_TileSpecial<"tile_randi",
    ["(shape: Any, rng: uint32, storage: str = \"register\") -> Any",
     "(shape: Any, rng: uint32, min: int, max: int, storage: str = "
     "\"register\") -> Any"],
     "tile of random integers, in [min, max) where bounds are given">;
def Warp_TileRandfName : Warp_TileSpecial<"tile_randf",
    ["(shape: Any, rng: uint32, storage: str = \"register\") -> Any",
     "(shape: Any, rng: uint32, min: float, max: float, storage: str = "
     "\"register\") -> Any"],
     "tile of random floats in [0, 1), or in [min, max)">;
def Warp_TileLoadName : Warp_TileSpecial<"tile_load",
    ["(a: array, shape: Any, offset: Any = None, storage: str = "
     "\"register\", bounds_check: Any = True, aligned: Any = False) -> "
     "Any"],
     "tile of array elements from an offset on; zero outside of the "
     "array">;
def Warp_TileLoadIndexedName : Warp_TileSpecial<"tile_load_indexed",
    ["(a: array, indices: Any, shape: Any, offset: Any = None, axis: Any"
     " = 0, storage: str = \"register\") -> Any"],
     "the same with indices along one dimension">;
def Warp_TileStoreName : Warp_TileSpecial<"tile_store",
    ["(a: array, t: Any, offset: Any = None, bounds_check: Any = True, "
     "aligned: Any = False) -> None"],
     "writes a tile to array elements; those outside are dropped">;
def Warp_TileStoreIndexedName : Warp_TileSpecial<"tile_store_indexed",
    ["(a: array, indices: Any, t: Any, offset: Any = None, axis: int = "
     "0) -> None"],
     "the same with indices along one dimension">;
def Warp_TileAtomicAddName : Warp_TileSpecial<"tile_atomic_add",
    ["(a: array, t: Any, offset: Any = None, bounds_check: Any = True) "
     "-> Any"],
     "adds a tile to array elements, each atomically; the old elements">;
def Warp_TileAtomicAddIndexedName : Warp_TileSpecial<"tile_atomic_add_indexed",
    ["(a: array, indices: Any, t: Any, offset: Any = None, axis: int = "
     "0) -> Any"],
     "the same with indices along one dimension">;
def Warp_TileViewName : Warp_TileSpecial<"tile_view",
    ["(t: Any, offset: Any, shape: Any = None) -> Any"],
     "part of a tile; assigning to it changes the tile">;
def Warp_TileSliceIndexedName : Warp_TileSpecial<"tile_slice_indexed",
    ["(t: Any, indices: tuple) -> Any"],
     "rows of a tile by a tile of indices, as `t[indices, :]`: a copy">;
def Warp_TileAssignName : Warp_TileSpecial<"tile_assign",
    ["(dst: Any, src: Any, offset: Any = None) -> None"],
     "replaces a part of a tile">;
def Warp_TileExtractName : Warp_TileSpecial<"tile_extract",
    ["(a: Any, *indices: int) -> Any"],
     "element of a tile, or component of one">;
def Warp_TileScatterAddName : Warp_TileSpecial<"tile_scatter_add",
    ["(a: Any, *indices: int, value: Any, has_value: Any = True, "
     "atomic: Any = True) -> None"],
     "each thread with a value adds it to an element">;
def Warp_TileScatterMaskedName : Warp_TileSpecial<"tile_scatter_masked",
    ["(a: Any, *indices: int, value: Any, has_value: Any = True) -> "
     "None"],
     "each thread with a value assigns it to an element">;
def Warp_TileTransposeName : Warp_TileSpecial<"tile_transpose",
    ["(a: Any) -> Any"],
     "tile of two dimensions with these exchanged">;
def Warp_TileBroadcastName : Warp_TileSpecial<"tile_broadcast",
    ["(a: Any, shape: Any) -> Any"],
     "tile repeated along dimensions of extent 1">;
def Warp_TileReshapeName : Warp_TileSpecial<"tile_reshape",
    ["(t: Any, shape: Any) -> Any"],
     "the same elements in another shape; one extent may be -1">;
def Warp_TileSqueezeName : Warp_TileSpecial<"tile_squeeze",
    ["(t: Any, axis: Any = None) -> Any"],
     "tile without dimensions of extent 1">;
def Warp_TileAstypeName : Warp_TileSpecial<"tile_astype",
    ["(t: Any, dtype: Any) -> Any"],
     "tile of converted elements">;
def Warp_TileMapName : Warp_TileSpecial<"tile_map",
    ["(op: Any, *args: Any) -> Any"],
     "function of corresponding elements of tiles; other operands are "
     "the same for all">;
def Warp_TileAxpyName : Warp_TileSpecial<"tile_axpy",
    ["(alpha: Any, src: Any, dest: Any) -> None"],
     "dest += alpha * src">;
def Warp_TileSumName : Warp_TileSpecial<"tile_sum",
    ["(a: Any, axis: Any = None) -> Any"],
     "sum of elements, all or along one dimension">;
def Warp_TileMinName : Warp_TileSpecial<"tile_min",
    ["(a: Any, axis: Any = None) -> Any"],
     "smallest element; NaN is skipped">;
def Warp_TileMaxName : Warp_TileSpecial<"tile_max",
    ["(a: Any, axis: Any = None) -> Any"],
     "largest element; NaN is skipped">;
def Warp_TileArgminName : Warp_TileSpecial<"tile_argmin",
    ["(a: Any, axis: Any = None) -> Any"],
     "position of the smallest element, the first of several">;
def Warp_TileArgmaxName : Warp_TileSpecial<"tile_argmax",
    ["(a: Any, axis: Any = None) -> Any"],
     "position of the largest element, the first of several">;
def Warp_TileDotName : Warp_TileSpecial<"tile_dot",
    ["(a: Any, b: Any) -> Any"],
     "sum of products of elements; inner products of composites">;
def Warp_TileReduceName : Warp_TileSpecial<"tile_reduce",
    ["(op: Any, a: Any, axis: Any = None) -> Any"],
     "elements combined by an associative function">;
def Warp_TileScanInclusiveName : Warp_TileSpecial<"tile_scan_inclusive",
    ["(a: Any) -> Any"],
     "sums of elements up to each">;
def Warp_TileScanExclusiveName : Warp_TileSpecial<"tile_scan_exclusive",
    ["(a: Any) -> Any"],
     "sums of elements before each">;
def Warp_TileScanMaxInclusiveName : Warp_TileSpecial<"tile_scan_max_inclusive",
    ["(a: Any) -> Any"],
     "largest elements up to each">;
def Warp_TileScanMinInclusiveName : Warp_TileSpecial<"tile_scan_min_inclusive",
    ["(a: Any) -> Any"],
     "smallest elements up to each">;
def Warp_TileSortName : Warp_TileSpecial<"tile_sort",
    ["(keys: Any, values: Any) -> None"],
     "sorts keys, and values along with them, in place; stable, NaN last">;
def Warp_TileMatmulName : Warp_TileSpecial<"tile_matmul",
    ["(a: Any, b: Any, alpha: Any = 1.0, precision: str = \"default\") -> "
     "Any",
     "(a: Any, b: Any, out: Any, alpha: Any = 1.0, beta: Any = 1.0, "
     "precision: str = \"default\") -> None"],
     "alpha a b, or out = alpha a b + beta out; floats of 16 bits are "
     "summed in float32">;
def Warp_TileCholeskyName : Warp_TileSpecial<"tile_cholesky",
    ["(A: Any, fill_mode: str = \"lower\") -> Any"],
     "triangular factor of a positive definite matrix, of which one "
     "triangle is read; NaN if it is not">;
def Warp_TileCholeskyInplaceName : Warp_TileSpecial<"tile_cholesky_inplace",
    ["(A: Any, fill_mode: str = \"lower\") -> None"],
     "the same, in place">;
def Warp_TileCholeskySolveName : Warp_TileSpecial<"tile_cholesky_solve",
    ["(L: Any, y: Any, fill_mode: str = \"lower\") -> Any"],
     "solution of a system whose matrix has this factor">;
def Warp_TileCholeskySolveInplaceName : Warp_TileSpecial<"tile_cholesky_solve_inplace",
    ["(L: Any, y: Any, fill_mode: str = \"lower\") -> None"],
     "the same, in place">;
def Warp_TileLowerSolveName : Warp_TileSpecial<"tile_lower_solve",
    ["(L: Any, y: Any) -> Any"],
     "solution of L x = y with the lower triangle">;
def Warp_TileLowerSolveInplaceName : Warp_TileSpecial<"tile_lower_solve_inplace",
    ["(L: Any, y: Any) -> None"],
     "the same, in place">;
def Warp_TileUpperSolveName : Warp_TileSpecial<"tile_upper_solve",
    ["(U: Any, z: Any) -> Any"],
     "solution of U x = z with the upper triangle">;
def Warp_TileUpperSolveInplaceName : Warp_TileSpecial<"tile_upper_solve_inplace",
    ["(U: Any, z: Any) -> None"],
     "the same, in place">;
def Warp_TileDiagAddName : Warp_TileSpecial<"tile_diag_add",
    ["(a: Any, d: Any) -> Any"],
     "square tile with its diagonal increased">;
def Warp_TileFftName : Warp_TileSpecial<"tile_fft",
    ["(inout: Any) -> None"],
     "Fourier transform of each row of complex numbers, in place, not "
     "normalised">;
def Warp_TileIfftName : Warp_TileSpecial<"tile_ifft",
    ["(inout: Any) -> None"],
     "inverse Fourier transform of each row, in place, not normalised">;

def Warp_TileStackName : Warp_TileSpecial<"tile_stack",
    ["(capacity: int, dtype: Any) -> Any"],
     "empty stack of the block, for at most `capacity` elements">;
def Warp_TileStackPushName : Warp_TileSpecial<"tile_stack_push",
    ["(s: Any, value: Any, has_value: bool) -> int"],
     "pushes what each thread has a value of, in the order of threads; the "
     "slot, or -1 without a value or room">;
def Warp_TileStackPopName : Warp_TileSpecial<"tile_stack_pop",
    ["(s: Any) -> Any"],
     "pops a value for each thread: the value and its slot, or zero and -1 "
     "if there is none left">;
def Warp_TileStackClearName : Warp_TileSpecial<"tile_stack_clear",
    ["(s: Any) -> None"],
     "empties a stack">;
def Warp_TileStackCountName : Warp_TileSpecial<"tile_stack_count",
    ["(s: Any) -> int"],
     "number of elements on a stack">;

#endif // WARP_TILE_SPECIALS_TD

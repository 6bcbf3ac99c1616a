//===- WarpTileSpecials.td - Builtins for tiles --------------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Signatures and calls: the front end binds arguments by the former, and makes
// operations of WarpTileOps.td by the latter.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TILE_SPECIALS_TD
#define WARP_TILE_SPECIALS_TD

include "WarpBuiltinBase.td"

class Warp_TileSpecial<string name, list<string> overloads, string summaryOf,
                       list<string> calls = []>
    : Warp_Special<name, "Tiles", overloads, summaryOf, calls>;

//===----------------------------------------------------------------------===//
// Values and threads
//===----------------------------------------------------------------------===//

def Warp_BlockDimName : Warp_TileSpecial<"block_dim",
    ["() -> int"],
    "number of threads of a block; 1 on a CPU",
    ["session.block_threads()"]>;
def Warp_TileName : Warp_TileSpecial<"tile",
    ["(x: value, preserve_type: const = False) -> tile"],
    "tile of what each thread of the block has; vectors become columns "
    "unless `preserve_type`",
    ["tiles.values.from_threads(node, x, preserve_type)"]> {
  let requirements = [
    RequireType<"x.type.kind != 'tile'",
      "expects a value of each thread">];
}
def Warp_UntileName : Warp_TileSpecial<"untile",
    ["(a: tile<A, D>) -> Any"],
    "what this thread has of a tile that `tile` could have made",
    ["make('to_threads', a, element=tiles.values.of_thread(A, D))"]> {
  let requirements = [
    RequireType<"len(D) <= 3",
      "expects at most three dimensions">,
    Require<"D[-1] == session.block_threads()",
      "argument must have {session.block_threads()} elements in its last "
      "dimension, one for each thread of the block, but has {D[-1]}">];
}
def Warp_TileFromThreadName : Warp_TileSpecial<"tile_from_thread",
    ["(shape: shape, value: value, thread_idx: Any, storage: "
     "'register'|'shared' = 'register') -> tile"],
    "the value of one thread in all elements",
    ["tiles.values.from_thread(node, shape, value, thread_idx)"]>;

class Warp_TileFill<string name, string value, string summary>
    : Warp_TileSpecial<name,
    ["(shape: shape, dtype: dtype = float, "
     "storage: 'register'|'shared' = 'register') -> tile"],
    summary, ["make('splat', " # value # ", shape=shape, element=dtype)"]>;
def Warp_TileZerosName : Warp_TileFill<"tile_zeros", "zero(dtype)",
    "tile of zeros">;
def Warp_TileEmptyName : Warp_TileFill<"tile_empty", "zero(dtype)",
    "tile of unspecified elements">;
def Warp_TileOnesName : Warp_TileFill<"tile_ones", "constant(dtype, 1)",
    "tile of ones"> {
  let requirements = [
    RequireType<"dtype.kind != 'struct'",
      "does not support Warp struct dtypes; use tile_full() with an explicit "
      "value">];
}
def Warp_TileFullName : Warp_TileSpecial<"tile_full",
    ["(shape: shape, value: Any, dtype: dtype = None, storage: "
     "'register'|'shared' = 'register') -> tile"],
    "tile with a value in all elements",
    ["tiles.values.full(node, shape, value, dtype)"]>;
def Warp_TileArangeName : Warp_TileSpecial<"tile_arange",
    ["(*args: Any, dtype: dtype = None, storage: 'register'|'shared' = "
     "'register') -> tile"],
    "tile of start, start + step, ... before stop, from constants",
    ["tiles.values.arange(node, args, dtype)"]>;

class Warp_TileRandom<string name, string draw, string summary>
    : Warp_TileSpecial<name,
    ["(shape: shape, rng: u32, storage: 'register'|'shared' = 'register') "
     "-> tile",
     "(shape: shape, rng: u32, min: Any, max: Any, "
     "storage: 'register'|'shared' = 'register') -> tile"],
    summary,
    ["tiles.randoms.drawn(node, '" # draw # "', shape, rng)",
     "tiles.randoms.drawn(node, '" # draw # "', shape, rng, min, max)"]>;
def Warp_TileRandiName : Warp_TileRandom<"tile_randi", "randi",
    "tile of random integers, in [min, max) where bounds are given">;
def Warp_TileRandfName : Warp_TileRandom<"tile_randf", "randf",
    "tile of random floats in [0, 1), or in [min, max)">;

//===----------------------------------------------------------------------===//
// Arrays
//===----------------------------------------------------------------------===//

def Warp_RankOfShape : Require<"len(shape) == k",
    "array argument must have same number of dimensions as the tile shape, "
    "trying to perform an {len(shape)} dimensional load from an array with "
    "{k} dimensions.">;
def Warp_RankOfTile : Require<"len(D) == k",
    "'a' argument must have the same number of dimensions as the 't' "
    "argument, got {k} and {len(D)}">;
def Warp_RowOfIndices : Require<"len(E) == 1",
    "indices argument must be a 1D tile, got {len(E)} dimensions instead.">;

def Warp_TileLoadName : Warp_TileSpecial<"tile_load",
    ["(a: array<k, A>, shape: shape, offset: offsets<a> = None, "
     "storage: 'register'|'shared' = 'register', bounds_check: const = True, "
     "aligned: Any = False) -> tile<A>"],
    "tile of array elements from an offset on; zero outside of the array",
    ["make('load', a, *offset, shape=shape, checked=bool(bounds_check))"]> {
  let requirements = [Warp_RankOfShape];
}
def Warp_TileLoadIndexedName : Warp_TileSpecial<"tile_load_indexed",
    ["(a: array<k, A>, indices: tile<B, E>, shape: shape, "
     "offset: offsets<a> = None, axis: axis<a> = 0, "
     "storage: 'register'|'shared' = 'register') -> tile<A>"],
    "the same with indices along one dimension",
    ["make('load', a, *offset, indices, shape=shape, axis=axis, "
     "picked=True)"]> {
  let requirements = [Warp_RankOfShape, Warp_RowOfIndices,
    Require<"E[0] == shape[axis]",
      "indices and shape disagree along axis {axis}: {E[0]} and "
      "{shape[axis]}">];
}

class Warp_TileStore<string name, string more, string result, string call,
                     string summary>
    : Warp_TileSpecial<name,
    ["(a: array<k, A>, t: tile<A, D>, offset: offsets<a> = None, "
     "bounds_check: const = True" # more # ") -> " # result], summary,
    ["make(" # call # ", checked=bool(bounds_check))"]> {
  let requirements = [Warp_RankOfTile];
}
def Warp_TileStoreName : Warp_TileStore<"tile_store", ", aligned: Any = False",
    "None", "'store', t, a, *offset",
    "writes a tile to array elements; those outside are dropped">;
def Warp_TileAtomicAddName : Warp_TileStore<"tile_atomic_add", "",
    "tile<A, D>", "'atomic', t, a, *offset, kind='add'",
    "adds a tile to array elements, each atomically; the old elements">;

class Warp_TileStoreIndexed<string name, string operation, string result>
    : Warp_TileSpecial<name,
    ["(a: array<k, A>, indices: tile<B, E>, t: tile<A, D>, "
     "offset: offsets<a> = None, axis: axis<a> = 0) -> " # result],
    "the same with indices along one dimension",
    ["make('" # operation # "', t, a, *offset, indices, kind='add', axis=axis, "
     "picked=True)"]> {
  let requirements = [Warp_RankOfTile, Warp_RowOfIndices];
}
def Warp_TileStoreIndexedName
    : Warp_TileStoreIndexed<"tile_store_indexed", "store", "None">;
def Warp_TileAtomicAddIndexedName
    : Warp_TileStoreIndexed<"tile_atomic_add_indexed", "atomic", "tile<A, D>">;

//===----------------------------------------------------------------------===//
// Parts
//===----------------------------------------------------------------------===//

def Warp_TileViewName : Warp_TileSpecial<"tile_view",
    ["(t: tile<A, D>, offset: Any, shape: shape = None) -> tile<A>"],
    "part of a tile; assigning to it changes the tile",
    ["tiles.places.view(node, t, argument('t'), offset, shape)"]>;
def Warp_TileSliceIndexedName : Warp_TileSpecial<"tile_slice_indexed",
    ["(t: tile<A, D>, indices: Any) -> tile<A>"],
    "rows of a tile by a tile of indices, as `t[indices, :]`: a copy",
    ["tiles.gathers.sliced(node, t, indices)"]>;
def Warp_TileAssignName : Warp_TileSpecial<"tile_assign",
    ["(dst: inout tile<A, D>, src: tile<B, E>, offset: offsets<dst> = None) "
     "-> None"],
    "replaces a part of a tile",
    ["make('insert', tiles.changes.of_element(node, src, A), dst, *offset, "
     "axes=[1] * len(D))"]> {
  let requirements = [
    Require<"len(D) == len(E)",
      "destination and source tiles must have the same rank, got {len(D)} "
      "and {len(E)}">,
    Require<"fits(E, D)",
      "source tile of shape {E} does not fit into a destination of shape {D}">];
}
def Warp_TileExtractName : Warp_TileSpecial<"tile_extract",
    ["(a: tile<A, D>, *indices: index<a>) -> Any"],
    "element of a tile, or component of one",
    ["tiles.changes.extracted(node, a, indices)"]> {
  let requirements = [
    Require<"len(indices) in (len(D), len(D) + len(A.shape))",
      "expects as many indices as tile shape {D} has extents, or those of a "
      "component, too, but got {len(indices)}",
      "", "tile_extract: incorrect number of indices">];
}

class Warp_TileScatter<string name, string kind, string summary, string more>
    : Warp_TileSpecial<name,
    ["(a: inout tile<A, D>, *indices: index<a>, value: Any, "
     "has_value: condition = True" # more # ") -> None"], summary,
    ["tiles.changes.scattered(node, '" # kind #
     "', a, indices, value, has_value)"]> {
  let requirements = [
    Require<"len(indices) == len(D)",
      "expects {len(D)} indices for tile shape {D}, but got {len(indices)}",
      "", name # ": incorrect number of indices">];
}
def Warp_TileScatterAddName : Warp_TileScatter<"tile_scatter_add", "add",
    "each thread with a value adds it to an element", ", atomic: Any = True">;
def Warp_TileScatterMaskedName : Warp_TileScatter<"tile_scatter_masked",
    "assign", "each thread with a value assigns it to an element", "">;

//===----------------------------------------------------------------------===//
// Shapes
//===----------------------------------------------------------------------===//

def Warp_TileTransposeName : Warp_TileSpecial<"tile_transpose",
    ["(a: tile<A, [M, N]>) -> tile<A, [N, M]>"],
    "tile of two dimensions with these exchanged",
    ["seen('a', 'transpose', [N, M], [1, 0])"]>;
def Warp_TileBroadcastName : Warp_TileSpecial<"tile_broadcast",
    ["(a: tile<A, D>, shape: shape) -> tile<A>"],
    "tile repeated along dimensions of extent 1",
    ["seen('a', 'broadcast', shape)"]> {
  let requirements = [
    Require<"tiles.shapes.repeats(D, shape)",
      "cannot broadcast shape {D} to {tuple(shape)}">];
}
def Warp_TileReshapeName : Warp_TileSpecial<"tile_reshape",
    ["(t: tile<A, D>, shape: Any) -> tile<A>"],
    "the same elements in another shape; one extent may be -1",
    ["seen('t', 'reshape', tiles.shapes.completed(node, D, shape))"]>;
def Warp_TileSqueezeName : Warp_TileSpecial<"tile_squeeze",
    ["(t: tile<A, D>, axis: Any = None) -> tile<A>"],
    "tile without dimensions of extent 1",
    ["seen('t', 'reshape', tiles.shapes.squeezed(node, D, axis))"]>;
def Warp_TileAstypeName : Warp_TileSpecial<"tile_astype",
    ["(t: tile<A, D>, dtype: dtype) -> tile"],
    "tile of converted elements",
    ["tiles.elements.converted(node, t, dtype)"]>;

//===----------------------------------------------------------------------===//
// Elements
//===----------------------------------------------------------------------===//

def Warp_TileMapName : Warp_TileSpecial<"tile_map",
    ["(op: Any, *args: value) -> tile"],
    "function of corresponding elements of tiles; other operands are the "
    "same for all",
    ["tiles.elements.map(node, op, args)"]>;
def Warp_TileAxpyName : Warp_TileSpecial<"tile_axpy",
    ["(alpha: Any, src: tile<A, D>, dest: inout tile<B, D>) -> None"],
    "dest += alpha * src",
    ["tiles.changes.axpy(node, alpha, src, dest, place('dest'))"]>;
def Warp_TileSumName : Warp_TileSpecial<"tile_sum",
    ["(a: tile<A, D>, axis: axis<a> = None) -> tile<A>"],
    "sum of elements, all or along one dimension",
    ["tiles.elements.summed(node, a, axis)"]>;

class Warp_TileExtremum<string name, string operation, string kind,
                        string summary>
    : Warp_TileSpecial<name,
    ["(a: tile<S, D>, axis: axis<a> = None) -> tile"], summary,
    ["make('" # operation # "', a, kind='" # kind # "', axis=axis)"]>;
def Warp_TileMinName : Warp_TileExtremum<"tile_min", "reduce", "min",
    "smallest element; NaN is skipped">;
def Warp_TileMaxName : Warp_TileExtremum<"tile_max", "reduce", "max",
    "largest element; NaN is skipped">;
def Warp_TileArgminName : Warp_TileExtremum<"tile_argmin", "arg_reduce", "min",
    "position of the smallest element, the first of several">;
def Warp_TileArgmaxName : Warp_TileExtremum<"tile_argmax", "arg_reduce", "max",
    "position of the largest element, the first of several">;

def Warp_TileDotName : Warp_TileSpecial<"tile_dot",
    ["(a: tile<A, D>, b: tile<B, D>) -> tile"],
    "sum of products of elements; inner products of composites",
    ["make('reduce', tiles.elements.inner(node, a, b), kind='add')"]>;
def Warp_TileReduceName : Warp_TileSpecial<"tile_reduce",
    ["(op: Any, a: tile<A, D>, axis: axis<a> = None) -> tile<A>"],
    "elements combined by an associative function",
    ["tiles.elements.reduced(node, op, a, axis)"]>;

class Warp_TileScan<string name, string kind, string exclusive, string summary>
    : Warp_TileSpecial<name, ["(a: tile<S, D>) -> tile<S, D>"], summary,
    ["make('scan', a, kind='" # kind # "', exclusive=" # exclusive # ")"]>;
def Warp_TileScanInclusiveName : Warp_TileScan<"tile_scan_inclusive", "add",
    "False", "sums of elements up to each">;
def Warp_TileScanExclusiveName : Warp_TileScan<"tile_scan_exclusive", "add",
    "True", "sums of elements before each">;
def Warp_TileScanMaxInclusiveName : Warp_TileScan<"tile_scan_max_inclusive",
    "max", "False", "largest elements up to each">;
def Warp_TileScanMinInclusiveName : Warp_TileScan<"tile_scan_min_inclusive",
    "min", "False", "smallest elements up to each">;

def Warp_TileSortName : Warp_TileSpecial<"tile_sort",
    ["(keys: inout tile<A, D>, values: inout tile<B, D>) -> None"],
    "sorts keys, and values along with them, in place; stable, NaN last",
    ["tiles.elements.sorted(keys, values)"]>;

#endif // WARP_TILE_SPECIALS_TD

//===- WarpTileOps.td - Cooperative operations of a block --*- tablegen -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Operations on tiles, which all threads of a block come by together. A tile is
// a value, so that derivatives are exact and placing it is a pass's business:
// what changes a tile gives another one. In a header of its own: few passes know
// them.
//
// An operand that is no tile may differ from thread to thread; element e then
// sees that of thread e mod B, of the B threads of the block.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TILE_OPS_TD
#define WARP_TILE_OPS_TD

include "mlir/IR/EnumAttr.td"
include "mlir/Interfaces/SideEffectInterfaces.td"
include "WarpTileAttributes.td"
include "WarpTileInterfaces.td"
include "WarpTileTypes.td"
include "WarpTypes.td"

class Warp_TileOp<string mnemonic, list<Trait> traits = [Pure]>
    : Warp_Op<mnemonic, traits> {
  let hasVerifier = 1;
}

def Warp_TileReduction : I32EnumAttr<"TileReduction",
    "how elements are combined", [
    I32EnumAttrCase<"add", 0>, I32EnumAttrCase<"min", 1>,
    I32EnumAttrCase<"max", 2>]> {
  let cppNamespace = "::warp";
}

def Warp_TileUpdate : I32EnumAttr<"TileUpdate", "how an element changes", [
    I32EnumAttrCase<"assign", 0>, I32EnumAttrCase<"add", 1>,
    I32EnumAttrCase<"sub", 2>, I32EnumAttrCase<"and_", 3, "and">,
    I32EnumAttrCase<"or_", 4, "or">, I32EnumAttrCase<"xor_", 5, "xor">,
    I32EnumAttrCase<"min", 6>, I32EnumAttrCase<"max", 7>]> {
  let cppNamespace = "::warp";
}

//===----------------------------------------------------------------------===//
// Making tiles
//===----------------------------------------------------------------------===//

def Warp_TileSplatOp : Warp_TileOp<"tile_splat"> {
  let summary = "the same value in all elements";
  let description = [{
    (C1) the value has the element type.

    ```mlir
    %t = warp.tile_splat %x : f32 -> !warp.tile<8x8 x f32>
    ```
  }];
  let arguments = (ins AnyType:$value);
  let results = (outs Warp_AnyTile:$result);
  let assemblyFormat = "$value attr-dict `:` type($value) `->` type($result)";
}

def Warp_TileEmptyOp : Warp_Op<"tile_empty", [Pure]> {
  let summary = "a tile of unspecified elements";
  let results = (outs Warp_AnyTile:$result);
  let assemblyFormat = "attr-dict `:` type($result)";
}

def Warp_TileIotaOp : Warp_TileOp<"tile_iota",
    [Pure, AllTypesMatch<["start", "step"]>]> {
  let summary = "start, start + step, start + 2 step, ...";
  let description = [{
    (C1) the tile has one dimension. (C2) both operands have its element type,
    a number.
  }];
  let arguments = (ins AnyType:$start, AnyType:$step);
  let results = (outs Warp_AnyTile:$result);
  let assemblyFormat = [{
    $start `,` $step attr-dict `:` type($start) `->` type($result)
  }];
}

def Warp_TileFromThreadsOp : Warp_TileOp<"tile_from_threads"> {
  let summary = "a tile of what each thread of the block holds";
  let description = [{
    Thread t gives the elements whose last index is t. A vector becomes a column
    of the tile, a matrix a slab, unless the element type is that of the value.

    (C1) the element type is that of the value, and the tile has one dimension,
    or it is its scalar type, and the tile has the extents of the composite
    before the last one.

    ```mlir
    %t = warp.tile_from_threads %x : f32 -> !warp.tile<256 x f32>
    ```
  }];
  let arguments = (ins AnyType:$value);
  let results = (outs Warp_AnyTile:$result);
  let assemblyFormat = "$value attr-dict `:` type($value) `->` type($result)";
}

def Warp_TileToThreadsOp : Warp_TileOp<"tile_to_threads"> {
  let summary = "what each thread of the block holds of a tile";
  let description = [{
    The inverse of `warp.tile_from_threads`. A thread beyond the tile gets zero.

    (C1) types are those of `warp.tile_from_threads`.
  }];
  let arguments = (ins Warp_AnyTile:$tile);
  let results = (outs AnyType:$result);
  let assemblyFormat = "$tile attr-dict `:` type($tile) `->` type($result)";
}

//===----------------------------------------------------------------------===//
// Memory
//===----------------------------------------------------------------------===//

/// `tile`: the accessor of the tile of elements; `written`: the tile that is
/// written.
class Warp_TileAccessOp<string mnemonic, string effect, string tile,
                        string written>
    : Warp_TileOp<mnemonic, [AttrSizedOperandSegments,
                             Warp_TileAccessOpInterface]> {
  let extraClassDeclaration = [{
    ::warp::AccessEffect getEffect() { return ::warp::AccessEffect::}] #
      effect # [{; }
    ::mlir::Value getWritten() { return }] # written # [{; }
    ::warp::TileType getTileType() {
      return ::llvm::cast<::warp::TileType>(}] # tile # [{.getType());
    }
  }];
}

def Warp_TileLoadOp
    : Warp_TileAccessOp<"tile_load", "Read", "getResult()", "{}"> {
  let summary = "a tile of array elements";
  let description = [{
    Element (i, j) is array element (offset 0 + i, offset 1 + j); outside of the
    array it is zero. `checked = false` promises that nothing is outside. With
    `picked`, the index along `axis` is offset + picked[i].

    (C1) the tile has the rank and the element type of the array. (C2) one offset
    per dimension. (C3) `picked` has one dimension, of the tile's extent along
    `axis`.

    ```mlir
    %t = warp.tile_load %a[%i, %j] : !warp.array<2 x f32>, (si32, si32)
      -> !warp.tile<16x16 x f32>
    ```
  }];
  let arguments = (ins Arg<Warp_AnyArray, "", [MemRead]>:$array,
                       Variadic<Warp_Integer>:$offsets,
                       Optional<Warp_AnyTile>:$picked,
                       DefaultValuedAttr<I64Attr, "0">:$axis,
                       DefaultValuedAttr<BoolAttr, "true">:$checked);
  let results = (outs Warp_AnyTile:$result);
  let assemblyFormat = [{
    $array `[` $offsets `]` (`picked` $picked^)? attr-dict `:` type($array) `,`
    `(` type($offsets) `)` (`,` type($picked)^)? `->` type($result)
  }];
}

def Warp_TileStoreOp
    : Warp_TileAccessOp<"tile_store", "Write", "getTile()", "getTile()"> {
  let summary = "writes a tile to array elements";
  let description = [{
    Elements outside of the array are dropped. Operands and constraints are those
    of `warp.tile_load`.
  }];
  let arguments = (ins Warp_AnyTile:$tile,
                       Arg<Warp_AnyArray, "", [MemWrite]>:$array,
                       Variadic<Warp_Integer>:$offsets,
                       Optional<Warp_AnyTile>:$picked,
                       DefaultValuedAttr<I64Attr, "0">:$axis,
                       DefaultValuedAttr<BoolAttr, "true">:$checked);
  let assemblyFormat = [{
    $tile `,` $array `[` $offsets `]` (`picked` $picked^)? attr-dict `:`
    type($tile) `,` type($array) `,` `(` type($offsets) `)`
    (`,` type($picked)^)?
  }];
}

def Warp_TileAtomicOp
    : Warp_TileAccessOp<"tile_atomic", "Update", "getTile()", "getTile()"> {
  let summary = "updates array elements, each atomically";
  let description = [{
    The result is what elements were before, zero for those outside of the array.
    Operands and constraints are those of `warp.tile_load`.
  }];
  let arguments = (ins Warp_TileUpdate:$kind, Warp_AnyTile:$tile,
                       Arg<Warp_AnyArray, "", [MemRead, MemWrite]>:$array,
                       Variadic<Warp_Integer>:$offsets,
                       Optional<Warp_AnyTile>:$picked,
                       DefaultValuedAttr<I64Attr, "0">:$axis,
                       DefaultValuedAttr<BoolAttr, "true">:$checked);
  let results = (outs Warp_AnyTile:$old);
  let assemblyFormat = [{
    $kind $tile `,` $array `[` $offsets `]` (`picked` $picked^)? attr-dict `:`
    type($tile) `,` type($array) `,` `(` type($offsets) `)`
    (`,` type($picked)^)?  `->` type($old)
  }];
}

//===----------------------------------------------------------------------===//
// Elementwise
//===----------------------------------------------------------------------===//

def Warp_TileMapOp : Warp_TileOp<"tile_map",
    [SingleBlock, RecursiveMemoryEffects]> {
  let summary = "a function of corresponding elements";
  let description = [{
    The block computes one element of each result from one of each tile among the
    operands; other operands are the same for all elements that a thread has.

    (C1) tiles have one shape, and there is one. (C2) the block has an argument
    per operand, of its element type or its type. (C3) it yields the elements of
    the results.

    ```mlir
    %c = warp.tile_map(%a, %s) {
    ^bb0(%x: f32, %y: f32):
      %p = warp.mul(%x, %y) : (f32, f32) -> f32
      warp.tile_yield %p : f32
    } : (!warp.tile<64 x f32>, f32) -> !warp.tile<64 x f32>
    ```
  }];
  let arguments = (ins Variadic<AnyType>:$inputs);
  let results = (outs Variadic<Warp_AnyTile>:$outputs);
  let regions = (region SizedRegion<1>:$body);
  let assemblyFormat = [{
    `(` $inputs `)` $body attr-dict `:` functional-type($inputs, $outputs)
  }];
}

def Warp_TileYieldOp : Warp_Op<"tile_yield", [Pure, Terminator,
    ParentOneOf<["::warp::TileMapOp", "::warp::TileFoldOp"]>]> {
  let summary = "elements that a function of elements gives";
  let arguments = (ins Variadic<AnyType>:$values);
  let assemblyFormat = "attr-dict ($values^ `:` type($values))?";
}

//===----------------------------------------------------------------------===//
// Shapes and parts
//===----------------------------------------------------------------------===//

def Warp_TileTransposeOp : Warp_TileOp<"tile_transpose"> {
  let summary = "a tile with its dimensions in another order";
  let description = [{
    Dimension d of the result is dimension `axes[d]` of the tile.

    (C1) `axes` is a permutation. (C2) extents follow it.
  }];
  let arguments = (ins Warp_AnyTile:$tile, DenseI64ArrayAttr:$axes);
  let results = (outs Warp_AnyTile:$result);
  let assemblyFormat = [{
    $tile `,` $axes attr-dict `:` type($tile) `->` type($result)
  }];
}

def Warp_TileReshapeOp : Warp_TileOp<"tile_reshape"> {
  let summary = "the same elements, in row-major order, in another shape";
  let description = "(C1) both tiles have the same elements.";
  let arguments = (ins Warp_AnyTile:$tile);
  let results = (outs Warp_AnyTile:$result);
  let assemblyFormat = "$tile attr-dict `:` type($tile) `->` type($result)";
}

def Warp_TileBroadcastOp : Warp_TileOp<"tile_broadcast"> {
  let summary = "a tile repeated along some dimensions";
  let description = [{
    Shapes are compared from the last dimension, as NumPy does.

    (C1) an extent of the tile is 1 or that of the result. (C2) the element types
    are the same.
  }];
  let arguments = (ins Warp_AnyTile:$tile);
  let results = (outs Warp_AnyTile:$result);
  let assemblyFormat = "$tile attr-dict `:` type($tile) `->` type($result)";
}

def Warp_TileSliceOp : Warp_TileOp<"tile_slice"> {
  let summary = "a part of a tile";
  let description = [{
    Element (i, j) is (offset 0 + steps[0] i, offset 1 + steps[1] j) of the tile.
    Elements outside of it are unspecified.

    (C1) one offset and one step per dimension. (C2) the element types are the
    same, and ranks too.
  }];
  let arguments = (ins Warp_AnyTile:$tile, Variadic<Warp_Integer>:$offsets,
                       DenseI64ArrayAttr:$steps);
  let results = (outs Warp_AnyTile:$result);
  let assemblyFormat = [{
    $tile `[` $offsets `]` $steps attr-dict `:` type($tile) `,` `(`
    type($offsets) `)` `->` type($result)
  }];
}

def Warp_TileInsertOp : Warp_TileOp<"tile_insert",
    [Pure, AllTypesMatch<["tile", "result"]>]> {
  let summary = "a tile with a part replaced";
  let description = [{
    The part is that of `warp.tile_slice`; its elements outside of the tile are
    dropped.
  }];
  let arguments = (ins Warp_AnyTile:$part, Warp_AnyTile:$tile,
                       Variadic<Warp_Integer>:$offsets,
                       DenseI64ArrayAttr:$steps);
  let results = (outs Warp_AnyTile:$result);
  let assemblyFormat = [{
    $part `,` $tile `[` $offsets `]` $steps attr-dict `:` type($part) `,`
    type($tile) `,` `(` type($offsets) `)`
  }];
}

def Warp_TileGetOp : Warp_TileOp<"tile_get"> {
  let summary = "an element of a tile";
  let description = [{
    Each thread may ask for another one. An index outside of the tile gives an
    unspecified element.

    (C1) one index per dimension. (C2) the result has the element type.
  }];
  let arguments = (ins Warp_AnyTile:$tile, Variadic<Warp_Integer>:$indices);
  let results = (outs AnyType:$result);
  let assemblyFormat = [{
    $tile `[` $indices `]` attr-dict `:` type($tile) `,` `(` type($indices) `)`
    `->` type($result)
  }];
}

def Warp_TileSetOp : Warp_TileOp<"tile_set",
    [Pure, AttrSizedOperandSegments, AllTypesMatch<["tile", "result"]>]> {
  let summary = "a tile in which threads have changed elements";
  let description = [{
    Each thread for which `where` holds, if there is one, changes one element; if
    several assign the same one, one of them wins. An index outside changes
    nothing. With `path` it is a part of the element that changes, and others
    stay, whoever changes them: fields by name, and how many of the `components`
    index the next vector, matrix or quaternion.

    (C1) one index per dimension. (C2) the value has the type of the element, or
    of the part.

    ```mlir
    %u = warp.tile_set assign %x, %t[%i] part ["v", 1][%k] : f32,
           !warp.tile<4 x !warp.struct<"S", {v: !warp.vec<3 x f32>}>>, (si32),
           (si32)
    ```
  }];
  let arguments = (ins Warp_TileUpdate:$kind, AnyType:$value,
                       Warp_AnyTile:$tile, Variadic<Warp_Integer>:$indices,
                       Variadic<Warp_Integer>:$components, Optional<I1>:$where,
                       OptionalAttr<ArrayAttr>:$path);
  let results = (outs Warp_AnyTile:$result);
  let assemblyFormat = [{
    $kind $value `,` $tile `[` $indices `]` (`part` $path^ `[` $components `]`)?
    (`where` $where^)? attr-dict `:` type($value) `,` type($tile) `,` `(`
    type($indices) `)` (`,` `(` type($components)^ `)`)?
  }];
  let builders = [OpBuilder<(ins "::mlir::Type":$result,
                                 "::warp::TileUpdate":$kind,
                                 "::mlir::Value":$value, "::mlir::Value":$tile,
                                 "::mlir::ValueRange":$indices,
                                 "::mlir::Value":$where)>];
}

//===----------------------------------------------------------------------===//
// Reductions
//===----------------------------------------------------------------------===//

def Warp_TileReduceOp : Warp_TileOp<"tile_reduce"> {
  let summary = "elements combined, all or along one dimension";
  let description = [{
    The order is fixed by shape and block. `min` and `max` skip NaN. Without
    `axis` the result has one element.

    (C1) the result has the element type; its shape is `1`, or that of the tile
    without `axis` (`1` if nothing is left). (C2) `min` and `max` are of numbers.
  }];
  let arguments = (ins Warp_TileReduction:$kind, Warp_AnyTile:$tile,
                       OptionalAttr<I64Attr>:$axis);
  let results = (outs Warp_AnyTile:$result);
  let assemblyFormat = [{
    $kind $tile (`axis` $axis^)? attr-dict `:` type($tile) `->` type($result)
  }];
}

def Warp_TileArgReduceOp : Warp_TileOp<"tile_arg_reduce"> {
  let summary = "position of the smallest or largest element";
  let description = [{
    The first of several, counted in row-major order, or along `axis`. NaN is
    skipped.

    (C1) `kind` is `min` or `max`. (C2) the result is of si32, in the shape of
    `warp.tile_reduce`.
  }];
  let arguments = (ins Warp_TileReduction:$kind, Warp_AnyTile:$tile,
                       OptionalAttr<I64Attr>:$axis);
  let results = (outs Warp_AnyTile:$result);
  let assemblyFormat = [{
    $kind $tile (`axis` $axis^)? attr-dict `:` type($tile) `->` type($result)
  }];
}

def Warp_TileFoldOp : Warp_TileOp<"tile_fold",
    [SingleBlock, RecursiveMemoryEffects]> {
  let summary = "elements combined by a function, in order";
  let description = [{
    The block combines what it has got of earlier elements with the next one.
    Without `axis` the result has one element. With `partials` the result is all
    that it got on the way, in the shape of the tile.

    (C1) the block has two arguments, yields one value, all of the element type.
    (C2) the result's shape is that of `warp.tile_reduce`, or with `partials`
    that of the tile.
  }];
  let arguments = (ins Warp_AnyTile:$tile, OptionalAttr<I64Attr>:$axis,
                       UnitAttr:$partials);
  let results = (outs Warp_AnyTile:$result);
  let regions = (region SizedRegion<1>:$body);
  let assemblyFormat = [{
    $tile (`axis` $axis^)? (`partials` $partials^)? $body attr-dict `:`
    type($tile) `->` type($result)
  }];
}

def Warp_TileScanOp : Warp_TileOp<"tile_scan",
    [Pure, AllTypesMatch<["tile", "result"]>]> {
  let summary = "elements combined with all before them, in row-major order";
  let description = [{
    `exclusive`: without the element itself, beginning with zero. `reverse`: with
    those after it.

    (C1) elements are numbers. (C2) only `add` is exclusive.
  }];
  let arguments = (ins Warp_TileReduction:$kind, Warp_AnyTile:$tile,
                       UnitAttr:$exclusive, UnitAttr:$reverse);
  let results = (outs Warp_AnyTile:$result);
  let assemblyFormat = [{
    $kind $tile (`exclusive` $exclusive^)? (`reverse` $reverse^)? attr-dict `:`
    type($tile)
  }];
}

def Warp_TileSortOp : Warp_TileOp<"tile_sort"> {
  let summary = "positions of the elements in ascending order";
  let description = [{
    In row-major order and stable; NaN is last. Positions lead from the sorted
    order to the tile.

    (C1) elements are numbers. (C2) the positions are si32, in the tile's shape.
  }];
  let arguments = (ins Warp_AnyTile:$keys);
  let results = (outs Warp_AnyTile:$positions);
  let assemblyFormat = "$keys attr-dict `:` type($keys) `->` type($positions)";
}

def Warp_TileGatherOp : Warp_TileOp<"tile_gather"> {
  let summary = "elements at positions";
  let description = [{
    Positions count elements in row-major order; outside of the tile they give
    zero.

    (C1) positions are integers, in the shape of the result. (C2) the element
    types are the same.
  }];
  let arguments = (ins Warp_AnyTile:$tile, Warp_AnyTile:$positions);
  let results = (outs Warp_AnyTile:$result);
  let assemblyFormat = [{
    $tile `[` $positions `]` attr-dict `:` type($tile) `,` type($positions) `->`
    type($result)
  }];
}

def Warp_TileScatterOp : Warp_TileOp<"tile_scatter",
    [Pure, AllTypesMatch<["tile", "result"]>]> {
  let summary = "a tile with elements added at positions";
  let description = [{
    The transpose of `warp.tile_gather`. Positions outside of the tile are
    dropped.

    (C1) positions are integers, in the shape of the part. (C2) the element types
    are the same.
  }];
  let arguments = (ins Warp_AnyTile:$part, Warp_AnyTile:$tile,
                       Warp_AnyTile:$positions);
  let results = (outs Warp_AnyTile:$result);
  let assemblyFormat = [{
    $part `,` $tile `[` $positions `]` attr-dict `:` type($part) `,`
    type($tile) `,` type($positions)
  }];
}

//===----------------------------------------------------------------------===//
// Linear algebra
//===----------------------------------------------------------------------===//

def Warp_TileMatmulOp : Warp_TileOp<"tile_matmul",
    [Pure, AttrSizedOperandSegments]> {
  let summary = "alpha a b + beta c";
  let description = [{
    Products are summed in the element type of the result, in f32 for floats of
    16 bits. An operand that is `transposed` has its two dimensions exchanged.

    (C1) tiles of two dimensions that fit, of floats. (C2) alpha and beta have
    the element type of the result, or of its sums.
  }];
  let arguments = (ins Warp_AnyTile:$a, Warp_AnyTile:$b,
                       Optional<Warp_AnyTile>:$c, Optional<AnyType>:$alpha,
                       Optional<AnyType>:$beta, UnitAttr:$transposeA,
                       UnitAttr:$transposeB);
  let results = (outs Warp_AnyTile:$result);
  let assemblyFormat = [{
    $a (`transposed` $transposeA^)? `,` $b (`transposed` $transposeB^)?
    (`add` $c^)? (`alpha` $alpha^)? (`beta` $beta^)? attr-dict `:` type($a)
    `,` type($b) (`add` type($c)^)? (`alpha` type($alpha)^)?
    (`beta` type($beta)^)? `->` type($result)
  }];
}

def Warp_TileCholeskyOp : Warp_TileOp<"tile_cholesky",
    [Pure, AllTypesMatch<["tile", "result"]>]> {
  let summary = "the triangular factor of a positive definite matrix";
  let description = [{
    Reads the lower triangle, or the upper one, and gives L of L L^T, or U of
    U^T U; the other triangle is zero. Other matrices give NaN.

    (C1) a square tile of f32 or f64.
  }];
  let arguments = (ins Warp_AnyTile:$tile, UnitAttr:$upper);
  let results = (outs Warp_AnyTile:$result);
  let assemblyFormat = "$tile (`upper` $upper^)? attr-dict `:` type($tile)";
}

def Warp_TileCholeskyAdjointOp : Warp_TileOp<"tile_cholesky_adjoint",
    [Pure, AllTypesMatch<["factor", "cotangent", "result"]>]> {
  let summary = "what the elements of a matrix do to its triangular factor";
  let description = [{
    Given the factor that `tile_cholesky` makes and the cotangent of it, that of
    the triangle that is read; the other one is zero, and not read of the
    cotangent.

    (C1) a square tile of f32 or f64.
  }];
  let arguments = (ins Warp_AnyTile:$factor, Warp_AnyTile:$cotangent,
                       UnitAttr:$upper);
  let results = (outs Warp_AnyTile:$result);
  let assemblyFormat = [{
    $factor (`upper` $upper^)? `,` $cotangent attr-dict `:` type($factor)
  }];
}

def Warp_TileSolveOp : Warp_TileOp<"tile_solve",
    [Pure, AllTypesMatch<["rhs", "result"]>]> {
  let summary = "solves with a triangular matrix";
  let description = [{
    With the lower triangle, or the upper one, of the matrix or, `transposed`, of
    its transpose: `upper` names the triangle before it is transposed.

    (C1) a square tile of f32 or f64. (C2) the right side has as many rows, one
    or two dimensions and the same element type.
  }];
  let arguments = (ins Warp_AnyTile:$matrix, Warp_AnyTile:$rhs, UnitAttr:$upper,
                       UnitAttr:$transposed);
  let results = (outs Warp_AnyTile:$result);
  let assemblyFormat = [{
    $matrix (`upper` $upper^)? (`transposed` $transposed^)? `,` $rhs attr-dict
    `:` type($matrix) `,` type($rhs)
  }];
}

def Warp_TileDiagAddOp : Warp_TileOp<"tile_diag_add",
    [Pure, AllTypesMatch<["tile", "result"]>]> {
  let summary = "a matrix with its diagonal increased";
  let description = [{
    (C1) a square tile, and one of as many elements in one dimension, of the same
    element type.
  }];
  let arguments = (ins Warp_AnyTile:$tile, Warp_AnyTile:$diagonal);
  let results = (outs Warp_AnyTile:$result);
  let assemblyFormat = [{
    $tile `,` $diagonal attr-dict `:` type($tile) `,` type($diagonal)
  }];
}

def Warp_TileFftOp : Warp_TileOp<"tile_fft",
    [Pure, AllTypesMatch<["tile", "result"]>]> {
  let summary = "the Fourier transform of each row";
  let description = [{
    Along the last dimension, not normalised. `inverse` has the other sign in the
    exponent.

    (C1) elements are complex numbers: vectors of two f32 or f64.
  }];
  let arguments = (ins Warp_AnyTile:$tile, UnitAttr:$inverse);
  let results = (outs Warp_AnyTile:$result);
  let assemblyFormat = [{
    $tile (`inverse` $inverse^)? attr-dict `:` type($tile)
  }];
}

//===----------------------------------------------------------------------===//
// Blocks of threads
//===----------------------------------------------------------------------===//

def Warp_BarrierOp : Warp_Op<"barrier",
    [Warp_ThreadPhase, MemoryEffects<[MemRead, MemWrite]>]> {
  let summary = "threads of a block wait for each other";
  let description = "All of them see the writes that come before it.";
  let assemblyFormat = "attr-dict";
}

def Warp_ThreadNumberOp : Warp_Op<"thread_number", [Pure, Warp_ThreadPhase]> {
  let summary = "number of the thread within its block";
  let results = (outs Warp_Integer:$result);
  let assemblyFormat = "attr-dict `:` type($result)";
}

def Warp_LaunchExtentOp : Warp_Op<"launch_extent", [Pure, Warp_ThreadPhase]> {
  let summary = "an extent of the launch";
  let arguments = (ins I64Attr:$axis);
  let results = (outs Warp_Integer:$result);
  let assemblyFormat = "$axis attr-dict `:` type($result)";
}

def Warp_BlockMemoryOp : Warp_Op<"block_memory", [Pure, Warp_ThreadPhase]> {
  let summary = "address in shared memory";
  let description = [{
    A block has one piece of memory; the place is `offset` bytes behind its start.
  }];
  let arguments = (ins I64Attr:$offset);
  let results = (outs Warp_Integer:$address);
  let assemblyFormat = "$offset attr-dict `:` type($address)";
}

#endif // WARP_TILE_OPS_TD

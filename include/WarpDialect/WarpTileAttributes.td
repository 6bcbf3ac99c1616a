//===- WarpTileAttributes.td - Layouts of tiles --------------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TILE_ATTRIBUTES_TD
#define WARP_TILE_ATTRIBUTES_TD

include "mlir/IR/AttrTypeBase.td"
include "mlir/IR/EnumAttr.td"
include "WarpDialect.td"

def Warp_TileStorage : I32EnumAttr<"TileStorage",
    "where the elements of a tile are", [
    I32EnumAttrCase<"memory", 0>, I32EnumAttrCase<"inlined", 1>,
    I32EnumAttrCase<"accumulators", 2>, I32EnumAttrCase<"distributed", 3>,
    I32EnumAttrCase<"replicated", 4>]> {
  let cppNamespace = "::warp";
  let genSpecializedAttr = 0;
}

def Warp_TileLayoutAttr : AttrDef<Warp_Dialect, "TileLayout"> {
  let mnemonic = "tile_layout";
  let summary = "where the elements of an operation's tiles are";
  let description = [{
    `warp.layout` of an operation that gives tiles; without it they are packed
    in shared memory. Storage:

    - `memory`: shared memory, rows `pitch` elements apart if that is not 0.
      With `swizzled`, chunks of a row are permuted for matrix instructions.
      `stages` steps of a pipelined loop are there or being loaded, by TMA if
      `tensor_map` is not 0: the offset of the map in the parameter block. With
      `barriers`, those of the stages lie behind them. A step that is
      `merged_extent` steps in one, along `merged_axis`, may lack the last ones.
    - `inlined`: nowhere; elements are computed where they are used.
    - `accumulators`: registers, in the layout of a product's sums.
    - `distributed`: registers of the threads that own the elements.
    - `replicated`: registers of all threads, each of which has the one element.

    (C1) only tiles in memory have a pitch, a swizzle, stages or a tensor map.
    (C2) there is a stage. (C3) barriers belong to a tensor map. (C4) an axis of
    merged steps is 0 or 1, and their extent is positive.

    ```mlir
    #warp.tile_layout<pitch = 64, swizzled = true, stages = 3>
    ```
  }];
  let parameters = (ins
    DefaultValuedParameter<"::warp::TileStorage",
                           "::warp::TileStorage::memory">:$storage,
    DefaultValuedParameter<"int64_t", "0">:$pitch,
    DefaultValuedParameter<"bool", "false">:$swizzled,
    DefaultValuedParameter<"int64_t", "1">:$stages,
    DefaultValuedParameter<"int64_t", "0">:$tensor_map,
    DefaultValuedParameter<"bool", "false">:$barriers,
    DefaultValuedParameter<"int64_t", "0">:$merged_axis,
    DefaultValuedParameter<"int64_t", "0">:$merged_extent);
  let assemblyFormat = "`<` struct(params) `>`";
  let genVerifyDecl = 1;
  let extraClassDeclaration = [{
    /// That of operations without the attribute.
    static TileLayoutAttr getPacked(::mlir::MLIRContext *context);
    bool isInRegisters() const {
      return getStorage() != ::warp::TileStorage::memory &&
             getStorage() != ::warp::TileStorage::inlined;
    }
    TileLayoutAttr withStorage(::warp::TileStorage storage) const;
    TileLayoutAttr withPitch(int64_t pitch) const;
    TileLayoutAttr withSwizzle(bool swizzled) const;
    TileLayoutAttr withStages(int64_t stages) const;
    TileLayoutAttr withTensorMap(int64_t map, bool barriers) const;
    TileLayoutAttr withMerged(int64_t axis, int64_t extent) const;
  }];
}

def Warp_TileFunctionAttr : AttrDef<Warp_Dialect, "TileFunction"> {
  let mnemonic = "tile_function";
  let summary = "the function of the device library for an operation on a GPU";
  let description = [{
    `warp.function` of an operation on tiles. `name` ends the function's name. A
    product has `slots` sums per thread, in the layout `accumulators`, which
    ends the names of functions for sums.

    (C1) there is a name. (C2) slots are positive if and only if accumulators
    have a layout.

    ```mlir
    #warp.tile_function<name = "f16_16x16_kn", accumulators = "mma_16x16",
                        slots = 8>
    ```
  }];
  let parameters = (ins
    StringRefParameter<"ending of the function's name">:$name,
    StringRefParameter<"layout of sums", "\"\"">:$accumulators,
    DefaultValuedParameter<"int64_t", "0">:$slots);
  let assemblyFormat = "`<` struct(params) `>`";
  let genVerifyDecl = 1;
}

#endif // WARP_TILE_ATTRIBUTES_TD

//===- WarpTileTypes.td - Tiles ------------------------------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// In a header of its own: few passes know tiles.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TILE_TYPES_TD
#define WARP_TILE_TYPES_TD

include "mlir/IR/AttrTypeBase.td"
include "WarpDialect.td"

def Warp_TileType : TypeDef<Warp_Dialect, "Tile"> {
  let mnemonic = "tile";
  let genVerifyDecl = 1;
  let summary = "elements that a block of threads holds together";
  let description = [{
    A value of the whole block, such as `!warp.tile<16x16 x f32>`, which says
    neither where its elements lie nor which thread has which.

    (C1) the rank is 1 to 4, and an extent 1 or more. (C2) the element type is a
    scalar, a vector, a matrix, a quaternion, a transform or a struct. (C3) it
    has at most 16777216 components.
  }];
  let parameters = (ins ArrayRefParameter<"int64_t">:$shape,
                        "::mlir::Type":$elementType);
  let assemblyFormat =
      "`<` custom<TileShape>($shape) custom<Nested>($elementType) `>`";
  let extraClassDeclaration = [{
    int64_t getRank() const { return getShape().size(); }
    int64_t getNumElements() const;
  }];
}

def Warp_AnyTile : Type<CPred<"::llvm::isa<::warp::TileType>($_self)">,
                        "a tile">;

#endif // WARP_TILE_TYPES_TD

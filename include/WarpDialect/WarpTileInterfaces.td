//===- WarpTileInterfaces.td - Interfaces of tile operations -*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TILE_INTERFACES_TD
#define WARP_TILE_INTERFACES_TD

include "mlir/IR/OpBase.td"

def Warp_TileAccessOpInterface : OpInterface<"TileAccessOp"> {
  let cppNamespace = "::warp";
  let description = [{
    An operation that reads, writes or updates a tile of array elements. Element
    (i, j) of the tile is array element (offset 0 + i, offset 1 + j); with a
    tile of picked indices, the index along one axis is offset + picked[i].
  }];
  let methods = [
    InterfaceMethod<"The array.", "::mlir::Value", "getArray">,
    InterfaceMethod<"The operand that is the array.", "::mlir::OpOperand &",
                    "getArrayMutable">,
    InterfaceMethod<"One offset per dimension.", "::mlir::OperandRange",
                    "getOffsets">,
    InterfaceMethod<"The operands that are offsets.",
                    "::mlir::MutableOperandRange", "getOffsetsMutable">,
    InterfaceMethod<"The tile of picked indices; null without one.",
                    "::mlir::Value", "getPicked">,
    InterfaceMethod<"The operand that is this tile.",
                    "::mlir::MutableOperandRange", "getPickedMutable">,
    InterfaceMethod<"The axis along which indices are picked.", "uint64_t",
                    "getAxis">,
    InterfaceMethod<"Elements may be outside of the array.", "bool",
                    "getChecked">,
    InterfaceMethod<"Says whether elements may be outside.", "void",
                    "setChecked", (ins "bool":$checked)>,
    InterfaceMethod<"The tile that is written; null for a load.",
                    "::mlir::Value", "getWritten">,
    InterfaceMethod<"The type of the tile of elements.", "::warp::TileType",
                    "getTileType">,
    InterfaceMethod<"What happens to the elements.", "::warp::AccessEffect",
                    "getEffect">,
  ];
  let extraSharedClassDeclaration = [{
    bool mayWrite() { return $_op.getEffect() != ::warp::AccessEffect::Read; }
    bool isUpdate() { return $_op.getEffect() == ::warp::AccessEffect::Update; }
  }];
}

def Warp_TileOpInterface : OpInterface<"TileOpInterface"> {
  let cppNamespace = "::warp";
  let description = [{
    An operation on tiles. Passes ask this interface; only the model of an
    operation, in the file of its family in lib/Transforms/Tiles, knows it by
    name. A block has B threads; element e of a tile is owned by thread e mod B.
  }];
  let methods = [
    // Elements.
    InterfaceMethod<"Elements of the result are elements of operand 0.", "bool",
                    "isView", (ins), [{}], [{ return false; }]>,
    InterfaceMethod<"An element can be computed where it is used: `element` "
                    "does so.", "bool", "isElementwise", (ins), [{}],
                    [{ return false; }]>,
    InterfaceMethod<"To compute an element again costs nothing.", "bool",
                    "isCheap", (ins), [{}], [{ return false; }]>,
    InterfaceMethod<"Each thread treats the elements that it owns.", "bool",
                    "isByOwners", (ins), [{}], [{ return false; }]>,
    InterfaceMethod<"Registers of their owners can hold the results.", "bool",
                    "canDistribute", (ins), [{}], [{ return false; }]>,
    InterfaceMethod<"The result is one element, which registers of all threads "
                    "can hold.", "bool", "canReplicate", (ins), [{}],
                    [{ return false; }]>,
    InterfaceMethod<"Which threads read elements of a tile, and how often.",
                    "::warp::TileRead", "getRead",
                    (ins "::mlir::OpOperand &":$use), [{}],
                    [{ return ::warp::TileRead::Any; }]>,
    InterfaceMethod<"A tile is read element by element, and not as memory.",
                    "bool", "readsElements", (ins "::mlir::OpOperand &":$use),
                    [{}], [{ return false; }]>,

    // Memory.
    InterfaceMethod<"Operands whose memory the result can take over, in order "
                    "of preference.", "::llvm::SmallVector<unsigned>",
                    "getReplaceableOperands", (ins), [{}], [{ return {}; }]>,
    InterfaceMethod<"Bytes of shared memory that the lowering needs besides "
                    "the tiles.", "int64_t", "getScratchBytes",
                    (ins "int64_t":$threads), [{}], [{ return 0; }]>,
    InterfaceMethod<"The function of the device library that computes the "
                    "operation on a GPU.", "::warp::TileFunction",
                    "getDeviceFunction", (ins "int64_t":$threads), [{}],
                    [{ return {}; }]>,

    // Code.
    InterfaceMethod<"One element of an elementwise operation.",
                    "::mlir::Value", "element",
                    (ins "::warp::tiles::TileLowering &":$lowering,
                         "::mlir::ValueRange":$indices), [{}],
                    [{ llvm_unreachable("elements are not independent"); }]>,
    InterfaceMethod<"Writes the code of the operation before it.", "void",
                    "lower", (ins "::warp::tiles::TileLowering &":$lowering)>,
    InterfaceMethod<"Turns cotangents of the results into cotangents of the "
                    "operands.", "::llvm::LogicalResult", "adjoint",
                    (ins "::warp::autodiff::TileReverse &":$reverse)>,
  ];
}

#endif // WARP_TILE_INTERFACES_TD

//===- WarpTableOps.td - Constant tables ---------------------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TABLE_OPS_TD
#define WARP_TABLE_OPS_TD

include "mlir/Interfaces/SideEffectInterfaces.td"
include "WarpTypes.td"

def Warp_TableAttr
    : Attr<CPred<"::llvm::isa<::mlir::DenseElementsAttr>($_self)">,
           "dense table"> {
  let storageType = "::mlir::DenseElementsAttr";
  let returnType = "::mlir::DenseElementsAttr";
  let convertFromStorage = "$_self";
}

def Warp_TableGetOp : Warp_Op<"table_get", [Pure, Warp_ThreadPhase]> {
  let summary = "element of a constant table";
  let description = [{
    An index below zero counts from the end of its dimension; one out of bounds
    is taken as the last. Debug launches report it. In thread IR a table has one
    dimension, and the index is in bounds. Derivatives are zero.

    A cast of an element is an element of a table of that type: each number is
    rounded once.

    (C1) there is an index for each dimension, which are static and not empty.
    (C2) an index is an integer, or with lanes one for each. (C3) the result has
    the element type, or with lanes is a vector of it.

    ```mlir
    %x = warp.table_get dense<[[1.0, 2.0], [3.0, 4.0]]> : tensor<2x2xf32>
        [%i, %j] : si32, si32 -> f32
    ```
  }];
  let arguments = (ins Warp_TableAttr:$table, Variadic<AnyType>:$indices);
  let results = (outs AnyType:$result);
  let assemblyFormat = [{
    $table `[` $indices `]` attr-dict `:` type($indices) `->` type($result)
  }];
  let hasFolder = 1;
  let hasVerifier = 1;
}

#endif // WARP_TABLE_OPS_TD

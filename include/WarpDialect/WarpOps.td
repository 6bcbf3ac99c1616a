//===- WarpOps.td - Structural operations of the dialect -----*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Operations whose operands depend on more than a list of overloads: constants,
// construction and access of composites and structs, thread indices, output.
// Arrays are in WarpArrayOps.td, the operations of thread IR in
// WarpThreadOps.td; WarpBuiltins.td lists the files of the builtins proper.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_OPS_TD
#define WARP_OPS_TD

include "mlir/IR/BuiltinAttributeInterfaces.td"
include "mlir/IR/EnumAttr.td"
include "mlir/IR/OpAsmInterface.td"
include "mlir/Interfaces/InferTypeOpInterface.td"
include "mlir/Interfaces/SideEffectInterfaces.td"
include "WarpAttributes.td"
include "WarpTypes.td"

//===----------------------------------------------------------------------===//
// Scalars
//===----------------------------------------------------------------------===//

def Warp_ConstantOp : Warp_Op<"constant",
    [Pure, ConstantLike, AllTypesMatch<["value", "result"]>]> {
  let summary = "scalar constant";
  let description = [{
    (C1) the type of the value is a scalar.

    ```mlir
    %0 = warp.constant 2 : si32
    ```
  }];
  let arguments = (ins TypedAttrInterface:$value);
  let results = (outs Warp_Scalar:$result);
  let assemblyFormat = "attr-dict $value";
  let hasFolder = 1;
}

def Warp_CastOp : Warp_Op<"cast", [Pure]> {
  let summary = "converts a number, or each component of a composite";
  let description = [{
    Float to integer saturates and sends NaN to zero; to boolean tests against
    zero. Signless integers and `index` may be converted from and to integers,
    which is how loop counters enter.

    (C1) both types are scalars, or composites of the same kind and shape.

    ```mlir
    %1 = warp.cast %0 : si32 to f32
    ```
  }];
  let arguments = (ins AnyType:$source);
  let results = (outs AnyType:$result);
  let assemblyFormat = "$source attr-dict `:` type($source) `to` type($result)";
  let hasFolder = 1;
  let hasVerifier = 1;
}

def Warp_BitcastOp : Warp_Op<"bitcast", [Pure]> {
  let summary = "reinterprets the bits of a value of the same size";
  let description = "(C1) both types have the same size in bytes.";
  let arguments = (ins Warp_Element:$source);
  let results = (outs Warp_Element:$result);
  let assemblyFormat = "$source attr-dict `:` type($source) `to` type($result)";
  let hasVerifier = 1;
}

//===----------------------------------------------------------------------===//
// Composites
//===----------------------------------------------------------------------===//

def Warp_ConstructOp : Warp_Op<"construct", [Pure]> {
  let summary = "builds a composite from its components";
  let description = [{
    Operands are scalars and composites, laid out one after the other in
    row-major order. One scalar fills all components; no operand gives zero.

    (C1) the components of the operands are as many as those of the result, or
    one, or none. (C2) they have the element type of the result.

    ```mlir
    %v = warp.construct(%x, %y, %z) : (f32, f32, f32) -> !warp.vec<3 x f32>
    ```
  }];
  let arguments = (ins Variadic<Warp_Element>:$components);
  let results = (outs Warp_Composite:$result);
  let assemblyFormat =
      "`(` $components `)` attr-dict `:` functional-type($components, $result)";
  let hasVerifier = 1;
}

def Warp_ExtractOp : Warp_Op<"extract", [Pure]> {
  let summary = "component, or matrix row, of a composite";
  let description = [{
    A negative index counts from the end. A matrix takes two indices for a
    component and one for a row. An index out of range gives an unspecified
    component.

    (C1) one index; a matrix takes one or two. (C2) the result is the component
    or row type.

    ```mlir
    %y = warp.extract %v[%c1] : !warp.vec<3 x f32>, si32 -> f32
    ```
  }];
  let arguments = (ins Warp_Composite:$source, Variadic<Warp_Integer>:$indices);
  let results = (outs Warp_Element:$result);
  let assemblyFormat = [{
    $source `[` $indices `]` attr-dict `:` type($source) `,` type($indices)
    `->` type($result)
  }];
  let hasFolder = 1;
  let hasVerifier = 1;
}

def Warp_InsertOp
    : Warp_Op<"insert", [Pure, AllTypesMatch<["target", "result"]>]> {
  let summary = "composite with one component, or matrix row, replaced";
  let description = [{
    An index out of range leaves the composite as it was or replaces an
    unspecified component.

    (C1) one index; a matrix takes one or two. (C2) the value has the component
    or row type.

    ```mlir
    %w = warp.insert %s, %v[%c1] : f32, !warp.vec<3 x f32>, si32
    ```
  }];
  let arguments = (ins Warp_Element:$value, Warp_Composite:$target,
                       Variadic<Warp_Integer>:$indices);
  let results = (outs Warp_Composite:$result);
  let assemblyFormat = [{
    $value `,` $target `[` $indices `]` attr-dict `:` type($value) `,`
    type($target) `,` type($indices)
  }];
  let hasVerifier = 1;
}

def Warp_PositionOp : Warp_Op<"position", [Pure]> {
  let summary = "place of an index that may count from the end";
  let description = [{
    The index, or the extent plus an index below zero. Debug launches report an
    index out of bounds.

    ```mlir
    %p = warp.position %i of 5 : si32 -> si32
    ```
  }];
  let arguments = (ins Warp_Integer:$index, I64Attr:$extent);
  let results = (outs Warp_Integer:$result);
  let assemblyFormat =
      "$index `of` $extent attr-dict `:` type($index) `->` type($result)";
  let hasFolder = 1;
}

def Warp_StructCreateOp : Warp_Op<"struct_create", [Pure]> {
  let summary = "builds a struct from its fields";
  let description = "(C1) operands match the fields in number and type.";
  let arguments = (ins Variadic<Warp_Value>:$fields);
  let results = (outs Warp_AnyStruct:$result);
  let assemblyFormat =
      "`(` $fields `)` attr-dict `:` functional-type($fields, $result)";
  let hasVerifier = 1;
}

def Warp_StructGetOp : Warp_Op<"struct_get", [Pure]> {
  let summary = "field of a struct";
  let description = "(C1) the field exists and has the result's type.";
  let arguments = (ins Warp_AnyStruct:$source, StrAttr:$field);
  let results = (outs Warp_Value:$result);
  let assemblyFormat =
      "$source `[` $field `]` attr-dict `:` type($source) `->` type($result)";
  let hasFolder = 1;
  let hasVerifier = 1;
}

def Warp_StructSetOp
    : Warp_Op<"struct_set", [Pure, AllTypesMatch<["target", "result"]>]> {
  let summary = "struct with one field replaced";
  let description = "(C1) the field exists and has the value's type.";
  let arguments = (ins Warp_Value:$value, Warp_AnyStruct:$target,
                       StrAttr:$field);
  let results = (outs Warp_AnyStruct:$result);
  let assemblyFormat = [{
    $value `,` $target `[` $field `]` attr-dict `:` type($value) `,`
    type($target)
  }];
  let hasVerifier = 1;
}

include "WarpArrayOps.td"

//===----------------------------------------------------------------------===//
// Threads and output
//===----------------------------------------------------------------------===//

def Warp_TidOp : Warp_Op<"tid", [Pure, Warp_ThreadPhase]> {
  let summary = "indices of the thread within the launch";
  let description = [{
    One to four indices, of the first dimensions of the launch. Dimensions that
    the launch does not have are zero.

    (C1) one to four results.

    ```mlir
    %i, %j = warp.tid : si32, si32
    ```
  }];
  let results = (outs Variadic<Warp_Integer>:$indices);
  let assemblyFormat = "attr-dict `:` type($indices)";
  let hasVerifier = 1;
}

def Warp_PrintfOp
    : Warp_Op<"printf", [Warp_ThreadPhase, MemoryEffects<[MemWrite]>]> {
  let summary = "formatted output from a thread";
  let description = [{
    (C1) at most 32 scalar operands. (C2) as many conversions in the format as
    operands.

    ```mlir
    warp.printf "%d %f\0A"(%i, %x) : si32, f32
    ```
  }];
  let arguments = (ins StrAttr:$format, Variadic<Warp_ThreadScalar>:$args);
  let assemblyFormat =
      "$format `(` $args `)` attr-dict (`:` type($args)^)?";
  let hasVerifier = 1;
}

def Warp_AssertOp
    : Warp_Op<"assert", [Warp_ThreadPhase, MemoryEffects<[MemWrite]>]> {
  let summary = "reports a failed condition in debug mode";
  let description = [{
    `always`: in other modes, too, as a failure of what the message says.
  }];
  let arguments = (ins I1:$condition, StrAttr:$message, UnitAttr:$always);
  let assemblyFormat = "$condition `,` $message (`always` $always^)? attr-dict";
}

def Warp_CheckIndexOp
    : Warp_Op<"check_index", [Warp_ThreadPhase, MemoryEffects<[MemWrite]>]> {
  let summary = "reports indices out of bounds in debug mode";
  let description = [{
    An index below zero counts from the end, unless these are `offsets`. The
    report says of what the indices are: "a vector".

    (C1) one to four indices, and as many extents.

    ```mlir
    warp.check_index [%i, %j] of [3, 3], "a matrix" : si32, si32
    ```
  }];
  let arguments = (ins Variadic<AnyType>:$indices,
                       DenseI64ArrayAttr:$extents, StrAttr:$what,
                       UnitAttr:$offsets);
  let assemblyFormat = [{
    `[` $indices `]` `of` $extents `,` $what (`offsets` $offsets^)? attr-dict
    `:` type($indices)
  }];
  let hasVerifier = 1;
}

include "WarpBuiltins.td"
include "WarpThreadOps.td"
include "WarpLaunchOps.td"
include "WarpScratchOps.td"
include "WarpTableOps.td"
include "WarpDerivativeOps.td"

#endif // WARP_OPS_TD

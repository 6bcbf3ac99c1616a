//===- WarpOps.td - Structural operations of the dialect -----*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Operations whose operands depend on more than a list of overloads: constants,
// construction and access of composites and structs, arrays and their views,
// thread indices, output. Builtins proper are in the Builtins*.td files, and
// the operations of thread IR in ThreadOps.td.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_OPS_TD
#define WARP_OPS_TD

include "mlir/IR/BuiltinAttributeInterfaces.td"
include "mlir/IR/EnumAttr.td"
include "mlir/IR/OpAsmInterface.td"
include "mlir/Interfaces/InferTypeOpInterface.td"
include "mlir/Interfaces/SideEffectInterfaces.td"
include "WarpTypes.td"

class Warp_Op<string mnemonic, list<Trait> traits = []>
    : Op<Warp_Dialect, mnemonic, traits>;

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

//===----------------------------------------------------------------------===//
// Arrays
//===----------------------------------------------------------------------===//

def Warp_LoadOp : Warp_Op<"load"> {
  let summary = "element of an array";
  let description = [{
    A negative index counts from the end.

    (C1) as many indices as the rank. (C2) the result has the element type.

    ```mlir
    %v = warp.load %a[%i] : !warp.array<1 x !warp.vec<3 x f32>>, si32
           -> !warp.vec<3 x f32>
    ```
  }];
  let arguments = (ins Arg<Warp_AnyArray, "", [MemRead]>:$array,
                       Variadic<Warp_Integer>:$indices);
  let results = (outs Warp_Element:$result);
  let assemblyFormat = [{
    $array `[` $indices `]` attr-dict `:` type($array) `,` type($indices)
    `->` type($result)
  }];
  let hasVerifier = 1;
}

def Warp_StoreOp : Warp_Op<"store"> {
  let summary = "writes an element of an array";
  let description = [{
    (C1) as many indices as the rank. (C2) the value has the element type.

    ```mlir
    warp.store %v, %a[%i] : f32, !warp.array<1 x f32>, si32
    ```
  }];
  let arguments = (ins Warp_Element:$value,
                       Arg<Warp_AnyArray, "", [MemWrite]>:$array,
                       Variadic<Warp_Integer>:$indices);
  let assemblyFormat = [{
    $value `,` $array `[` $indices `]` attr-dict `:` type($value) `,`
    type($array) `,` type($indices)
  }];
  let hasVerifier = 1;
}

def Warp_AtomicKind : I32EnumAttr<"AtomicKind", "how an atomic combines", [
    I32EnumAttrCase<"add", 0>, I32EnumAttrCase<"sub", 1>,
    I32EnumAttrCase<"min", 2>, I32EnumAttrCase<"max", 3>,
    I32EnumAttrCase<"bit_and", 4, "and">, I32EnumAttrCase<"bit_or", 5, "or">,
    I32EnumAttrCase<"bit_xor", 6, "xor">, I32EnumAttrCase<"exch", 7>]> {
  let cppNamespace = "::warp";
}

def Warp_AtomicOp : Warp_Op<"atomic"> {
  let summary = "atomic read-modify-write of an array element";
  let description = [{
    Each component is updated atomically; the old value is returned. Ordering
    is relaxed.

    (C1) as many indices as the rank. (C2) the value has the element type and
    so has the result. (C3) the element is a number or a composite of numbers;
    bitwise kinds take integers.

    ```mlir
    %old = warp.atomic add %v, %a[%i] : f32, !warp.array<1 x f32>, si32
    ```
  }];
  let arguments = (ins Warp_AtomicKind:$kind, Warp_Element:$value,
                       Arg<Warp_AnyArray, "", [MemRead, MemWrite]>:$array,
                       Variadic<Warp_Integer>:$indices);
  let results = (outs Warp_Element:$old);
  let assemblyFormat = [{
    $kind $value `,` $array `[` $indices `]` attr-dict `:` type($value) `,`
    type($array) `,` type($indices) `->` type($old)
  }];
  let hasVerifier = 1;
}

def Warp_AtomicCasOp : Warp_Op<"atomic_cas"> {
  let summary = "atomic compare and exchange of an array element";
  let description = [{
    Writes `value` where the element equals `expected`; returns the old value.

    (C1) as many indices as the rank. (C2) `expected`, `value` and the result
    have the element type. (C3) the element is a number of 4 or 8 bytes.
  }];
  let arguments = (ins Warp_ThreadScalar:$expected, Warp_ThreadScalar:$value,
                       Arg<Warp_AnyArray, "", [MemRead, MemWrite]>:$array,
                       Variadic<Warp_Integer>:$indices);
  let results = (outs Warp_ThreadScalar:$old);
  let assemblyFormat = [{
    $expected `,` $value `,` $array `[` $indices `]` attr-dict `:`
    type($expected) `,` type($value) `,` type($array) `,` type($indices)
    `->` type($old)
  }];
  let hasVerifier = 1;
}

def Warp_ViewOp : Warp_Op<"view", [Pure]> {
  let summary = "array of lower rank at leading indices";
  let description = [{
    `a[i]` of a rank-3 array is a view of rank 2.

    (C1) fewer indices than the rank, and at least one. (C2) the result has the
    remaining rank and the same element type.
  }];
  let arguments = (ins Warp_AnyArray:$array, Variadic<Warp_Integer>:$indices);
  let results = (outs Warp_AnyArray:$result);
  let assemblyFormat = [{
    $array `[` $indices `]` attr-dict `:` type($array) `,` type($indices)
    `->` type($result)
  }];
  let hasVerifier = 1;
}

def Warp_SliceOp
    : Warp_Op<"slice", [Pure, AllTypesMatch<["array", "result"]>]> {
  let summary = "part of an array along one dimension";
  let description = [{
    Elements `start`, `start + step`, ... before `stop` of dimension `dim`, as
    Python slices do with a positive step: negative bounds count from the end
    and both bounds are clamped to the extent.

    (C1) `dim` is within the rank.
  }];
  let arguments = (ins Warp_AnyArray:$array, I64Attr:$dim, Warp_Integer:$start,
                       Warp_Integer:$stop, Warp_Integer:$step);
  let results = (outs Warp_AnyArray:$result);
  let assemblyFormat = [{
    $array `[` $start `:` $stop `:` $step `]` `dim` $dim attr-dict `:`
    type($array) `,` type($start) `,` type($stop) `,` type($step)
  }];
  let hasVerifier = 1;
}

def Warp_ComponentViewOp : Warp_Op<"component_view", [Pure]> {
  let summary = "array of one component, row or field of each element";
  let description = [{
    Keeps extents and strides and moves the data pointer, so that a single slot
    of an element can be loaded, stored or updated atomically.

    (C1) `field` is given exactly when elements are structs, and names a field;
    otherwise indices are as for `extract`. (C2) the result's element type is
    that of the component, row or field.
  }];
  let arguments = (ins Warp_AnyArray:$array, Variadic<Warp_Integer>:$indices,
                       OptionalAttr<StrAttr>:$field);
  let results = (outs Warp_AnyArray:$result);
  let assemblyFormat = [{
    $array `[` $indices `]` (`field` $field^)? attr-dict `:` type($array)
    (`,` type($indices)^)? `->` type($result)
  }];
  let hasVerifier = 1;
}

def Warp_DimOp : Warp_Op<"dim", [Pure]> {
  let summary = "extent of an array along one dimension";
  let description = "(C1) `dim` is within the rank.";
  let arguments = (ins Warp_AnyArray:$array, I64Attr:$dim);
  let results = (outs Warp_Integer:$result);
  let assemblyFormat = [{
    $array `,` $dim attr-dict `:` type($array) `->` type($result)
  }];
  let hasVerifier = 1;
}

//===----------------------------------------------------------------------===//
// Threads and output
//===----------------------------------------------------------------------===//

def Warp_TidOp : Warp_Op<"tid", [Pure]> {
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

def Warp_PrintfOp : Warp_Op<"printf", [MemoryEffects<[MemWrite]>]> {
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

def Warp_AssertOp : Warp_Op<"assert", [MemoryEffects<[MemWrite]>]> {
  let summary = "reports a failed condition in debug mode";
  let arguments = (ins I1:$condition, StrAttr:$message);
  let assemblyFormat = "$condition `,` $message attr-dict";
}

include "WarpBuiltins.td"
include "WarpThreadOps.td"
include "WarpLaunchOps.td"

#endif // WARP_OPS_TD

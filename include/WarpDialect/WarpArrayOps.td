//===- WarpArrayOps.td - Accesses and views of arrays --------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// An array is a descriptor: accesses go through it, views make another one.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_ARRAY_OPS_TD
#define WARP_ARRAY_OPS_TD

include "mlir/IR/EnumAttr.td"
include "mlir/Interfaces/SideEffectInterfaces.td"
include "WarpInterfaces.td"
include "WarpTypes.td"

/// An access: `written` is the number of the operand group that is stored or
/// combined, -1 if none is; `combination` and `atomic` are C++ expressions.
class Warp_AccessOp<string mnemonic, string effect, int written,
                    string combination = "std::nullopt",
                    string atomic = "false", list<Trait> traits = []>
    : Warp_Op<mnemonic, traits # [Warp_AccessOpInterface]> {
  let extraClassDeclaration =
      "::warp::AccessEffect getEffect() { return ::warp::AccessEffect::"
      # effect # "; }\n"
      # "::mlir::OperandRange getWritten() { return "
      # !if(!lt(written, 0), "getOperation()->getOperands().take_front(0)",
            "getODSOperands(" # written # ")")
      # "; }\n"
      # "std::optional<::warp::AtomicKind> getCombination() { return "
      # combination # "; }\n"
      # "bool isAtomic() { return " # atomic # "; }\n";
}

def Warp_LoadOp : Warp_AccessOp<"load", "Read", -1> {
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

def Warp_StoreOp : Warp_AccessOp<"store", "Write", 0> {
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

def Warp_AtomicOp
    : Warp_AccessOp<"atomic", "Update", 0, "getKind()", "true"> {
  let summary = "atomic read-modify-write of an array element";
  let description = [{
    Each component is updated atomically; the old value is returned. Ordering
    is relaxed.

    (C1) as many indices as the rank. (C2) the value has the element type and
    so has the result. (C3) the element is a number or a composite of numbers;
    bitwise kinds take integers.

    ```mlir
    %old = warp.atomic add %v, %a[%i] : f32, !warp.array<1 x f32>, si32
      -> f32
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

def Warp_AtomicCasOp
    : Warp_AccessOp<"atomic_cas", "Update", 1, "std::nullopt", "true",
                    [Warp_ThreadPhase]> {
  let summary = "atomic compare and exchange of an array element";
  let description = [{
    Writes `value` where the element equals `expected`; returns the old value.

    (C1) as many indices as the rank. (C2) `expected`, `value` and the result
    have the element type. (C3) the element is a number.
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

//===----------------------------------------------------------------------===//
// Gradients
//===----------------------------------------------------------------------===//

def Warp_GradOp : Warp_Op<"grad", [Pure, Warp_ThreadPhase]> {
  let summary = "array of the gradients of an array's elements";
  let description = [{
    Same extents, and the memory that the descriptor names as the gradient's.
    Components of 16 bits have gradients of 32, at twice the strides; elements
    of any other type are their own gradient's type. The operand is an argument
    of the kernel or a field of one: a view of gradients is taken of the
    gradients.

    (C1) the result is `array<rank x gradient type of the element>`.

    ```mlir
    %g = warp.grad %a : !warp.array<1 x f16> -> !warp.array<1 x f32>
    ```
  }];
  let arguments = (ins Warp_AnyArray:$array);
  let results = (outs Warp_AnyArray:$result);
  let builders = [OpBuilder<(ins "::mlir::Value":$array)>];
  let assemblyFormat = [{
    $array attr-dict `:` type($array) `->` type($result)
  }];
  let hasVerifier = 1;
}

def Warp_AccumulateOp
    : Warp_AccessOp<"accumulate", "Update", 0, "::warp::AtomicKind::add",
                    "!getUnique()"> {
  let summary = "adds to an element of an array";
  let description = [{
    Threads may add to one element in any order. `unique = N` says that in a
    launch of at most N dimensions no two threads have the same indices, so
    that nothing has to be atomic.

    (C1) as many indices as the rank. (C2) the value has the element type.
    (C3) that is a float or a composite of floats. (C4) `unique` is 1 to 4.

    ```mlir
    warp.accumulate %v, %g[%i] {unique = 1} : f32, !warp.array<1 x f32>, si32
    ```
  }];
  let arguments = (ins Warp_Element:$value,
                       Arg<Warp_AnyArray, "", [MemRead, MemWrite]>:$array,
                       Variadic<Warp_Integer>:$indices,
                       OptionalAttr<I64Attr>:$unique);
  let assemblyFormat = [{
    $value `,` $array `[` $indices `]` attr-dict `:` type($value) `,`
    type($array) `,` type($indices)
  }];
  let hasVerifier = 1;
}

//===----------------------------------------------------------------------===//
// Addresses
//===----------------------------------------------------------------------===//

def Warp_ArrayAtOp : Warp_Op<"array_at", [Pure, Warp_ThreadPhase,
                                          AttrSizedOperandSegments]> {
  let summary = "packed array at an address";
  let description = [{
    Nothing is known of the memory: it may be that of any other array. An array
    at address 0 is no array, as where a launch is given none.

    `grad` is the address of what derivatives know of the elements: gradients in
    reverse mode, tangents in forward mode, one array after the other if there
    are several directions. At 0 there are none. Values do not depend on it.

    (C1) as many extents as the rank. (C2) elements with `grad` are floats or
    composites of floats.

    ```mlir
    %a = warp.array_at %p[%n] : ui64, si32 -> !warp.array<1 x f32>
    %b = warp.array_at %p[%n] grad(%g : ui64) : ui64, si32
      -> !warp.array<1 x f32>
    ```
  }];
  let arguments = (ins Warp_Integer:$address, Variadic<Warp_Integer>:$extents,
                       Optional<Warp_Integer>:$grad);
  let results = (outs Warp_AnyArray:$result);
  let builders = [OpBuilder<(ins "::mlir::Type":$type, "::mlir::Value":$address,
                                 "::mlir::ValueRange":$extents)>];
  let assemblyFormat = [{
    $address `[` $extents `]` (`grad` `(` $grad^ `:` type($grad) `)`)? attr-dict
    `:` type($address) `,` type($extents) `->` type($result)
  }];
  let hasVerifier = 1;
}

def Warp_PointerOp : Warp_Op<"pointer", [Pure, Warp_ThreadPhase]> {
  let summary = "address of an array's first element";
  let description = [{
    ```mlir
    %p = warp.pointer %a : !warp.array<1 x f32> -> ui64
    ```
  }];
  let arguments = (ins Warp_AnyArray:$array);
  let results = (outs Warp_Integer:$result);
  let assemblyFormat = [{
    $array attr-dict `:` type($array) `->` type($result)
  }];
}

def Warp_StrideOp : Warp_Op<"stride", [Pure, Warp_ThreadPhase]> {
  let summary = "bytes from one element to the next along one dimension";
  let description = "(C1) `dim` is within the rank.";
  let arguments = (ins Warp_AnyArray:$array, I64Attr:$dim);
  let results = (outs Warp_Integer:$result);
  let assemblyFormat = [{
    $array `,` $dim attr-dict `:` type($array) `->` type($result)
  }];
  let hasVerifier = 1;
}

//===----------------------------------------------------------------------===//
// Views
//===----------------------------------------------------------------------===//

def Warp_ViewOp : Warp_Op<"view", [Pure, Warp_ThreadPhase,
                                   Warp_ArrayViewOpInterface]> {
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
    : Warp_Op<"slice", [Pure, Warp_ThreadPhase, Warp_ArrayViewOpInterface,
                        AllTypesMatch<["array", "result"]>]> {
  let summary = "part of an array along one dimension";
  let description = [{
    Elements `start`, `start + step`, ... before `stop` of dimension `dim`, as
    Python slices do: negative bounds count from the end, both bounds are
    clamped to the extent, and a negative step goes backwards. A step of 0
    selects nothing; what the front end makes asserts that there is none.

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

def Warp_IndexDimOp
    : Warp_Op<"index_dim", [Pure, Warp_ThreadPhase,
                            Warp_ArrayViewOpInterface]> {
  let summary = "array of lower rank at an index of any dimension";
  let description = [{
    `a[:, j]` of a rank-2 array is one of rank 1. For a leading dimension this
    is a `view`.

    (C1) `dim` is within the rank. (C2) the result has one dimension less, at
    least one, and the same element type.

    ```mlir
    %c = warp.index_dim %a[%j] dim 1 : !warp.array<2 x f32>, si32
           -> !warp.array<1 x f32>
    ```
  }];
  let arguments = (ins Warp_AnyArray:$array, I64Attr:$dim, Warp_Integer:$index);
  let results = (outs Warp_AnyArray:$result);
  let assemblyFormat = [{
    $array `[` $index `]` `dim` $dim attr-dict `:` type($array) `,`
    type($index) `->` type($result)
  }];
  let hasVerifier = 1;
}

def Warp_ComponentViewOp
    : Warp_Op<"component_view", [Pure, Warp_ThreadPhase,
                                 Warp_ArrayViewOpInterface]> {
  let summary = "array of one component, row or field of each element";
  let description = [{
    Keeps extents and strides and moves the data pointer, so that a single slot
    of an element can be loaded, stored or updated atomically.

    The fields of a transform are its vector "p" and its quaternion "q".

    (C1) `field` is given when elements are structs, and names a field; otherwise
    indices are as for `extract`, or `field` is that of a transform. (C2) the
    result's element type is that of the component, row or field.
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

def Warp_DimOp : Warp_Op<"dim", [Pure, Warp_ThreadPhase]> {
  let summary = "extent of an array along one dimension";
  let description = "(C1) `dim` is within the rank.";
  let arguments = (ins Warp_AnyArray:$array, I64Attr:$dim);
  let results = (outs Warp_Integer:$result);
  let assemblyFormat = [{
    $array `,` $dim attr-dict `:` type($array) `->` type($result)
  }];
  let hasVerifier = 1;
}

#endif // WARP_ARRAY_OPS_TD

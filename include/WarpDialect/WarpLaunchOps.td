//===- WarpLaunchOps.td - A launch as a region ---------------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Phase `launch`: the threads of a group (a range of indices on a CPU, a block
// on a GPU) are one region, so that passes can say what happens once, what each
// thread does, and what threads do together. Which loops or grid that becomes
// is decided by warp-emit-entry.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LAUNCH_OPS_TD
#define WARP_LAUNCH_OPS_TD

include "mlir/IR/EnumAttr.td"
include "mlir/Interfaces/SideEffectInterfaces.td"
include "WarpArrayOps.td"

def Warp_GroupOp : Warp_Op<"group", [SingleBlock, NoTerminator,
                                     RecursiveMemoryEffects]> {
  let summary = "what a group of threads does";
  let description = [{
    Runs once per range of linear indices on a CPU, once per block on a GPU.
    Outside of `warp.threads` values are the same for the whole group, and
    effects stand in `warp.once`.

    (C1) it stands in a function, which has no other. (C2) it holds one
    `warp.threads`.
  }];
  let regions = (region SizedRegion<1>:$body);
  let assemblyFormat = "attr-dict-with-keyword $body";
  let hasVerifier = 1;
}

def Warp_ThreadsOp : Warp_Op<"threads", [SingleBlock,
                                         RecursiveMemoryEffects]> {
  let summary = "the threads of a group";
  let description = [{
    The block's arguments are the indices of the thread, one per dimension of
    the launch. The yields of the region are combined over all threads of the
    group; a group has at least one.

    With `lanes = N` the region does the work of N threads that follow each
    other in the last dimension: its last index is that of the first of them,
    and a mask tells which of them the launch has.

    Once threads are mapped to the grid of a GPU there are no indices: all
    threads of the grid run the region, which reads its place there.

    (C1) up to 4 indices, one per dimension, i32, and with `lanes` a mask after
    them.
    (C2) `kinds` and `types` have an entry for each value that is yielded; the
    types still have their sign. (C3) results have those types, signless; with
    `lanes` vectors of them are yielded.

    ```mlir
    %sum = warp.threads attributes {kinds = array<i32: 0>, types = [f64]} {
    ^bb0(%i: i32):
      // %v
      warp.yield %v : f64
    } : f64
    ```
  }];
  let arguments = (ins DenseI32ArrayAttr:$kinds, TypeArrayAttr:$types,
                       OptionalAttr<I64Attr>:$lanes);
  let results = (outs Variadic<AnyType>:$combined);
  let regions = (region SizedRegion<1>:$body);
  let assemblyFormat = [{
    attr-dict-with-keyword $body (`:` type($combined)^)?
  }];
  let hasVerifier = 1;
  let extraClassDeclaration = [{
    ::mlir::Block *getThread() { return &getBody().front(); }
    /// Number of threads that the region stands for.
    int64_t getWidth() { return getLanes().value_or(1); }
    /// Indices of the thread, or of the first of several.
    ::llvm::ArrayRef<::mlir::BlockArgument> getIndices() {
      return getThread()->getArguments().drop_back(getLanes() ? 1 : 0);
    }
    /// With lanes: which threads there are.
    ::mlir::Value getLive() {
      return getLanes() ? getThread()->getArguments().back() : ::mlir::Value();
    }
    ::mlir::Operation *getYield() { return getThread()->getTerminator(); }
  }];
}

def Warp_LaunchReversedOp : Warp_Op<"launch_reversed", [Pure]> {
  let summary = "true if this launch runs its blocks from the last to the first";
  let description = [{
    The runtime decides for each launch whose schedule allows it.
  }];
  let results = (outs I1:$result);
  let assemblyFormat = "attr-dict";
}

def Warp_OnceOp : Warp_Op<"once", [SingleBlock, NoTerminator,
                                   RecursiveMemoryEffects]> {
  let summary = "what one thread does for its group";
  let description = [{
    On a GPU the first thread of the block.

    (C1) it stands in a `warp.group`, outside of its threads.
  }];
  let regions = (region SizedRegion<1>:$body);
  let assemblyFormat = "attr-dict-with-keyword $body";
  let hasVerifier = 1;
}

def Warp_YieldOp : Warp_Op<"yield", [Pure, Terminator,
    ParentOneOf<["::warp::ThreadsOp", "::warp::EachLaneOp"]>]> {
  let summary = "what a region of threads or of one lane results in";
  let arguments = (ins Variadic<AnyType>:$values);
  let assemblyFormat = "attr-dict ($values^ `:` type($values))?";
}

//===----------------------------------------------------------------------===//
// Lanes
//===----------------------------------------------------------------------===//

def Warp_LanesOf : Type<CPred<"::llvm::isa<::mlir::VectorType>($_self) && "
    "::llvm::cast<::mlir::VectorType>($_self).getRank() == 1">,
    "a value per lane">;
def Warp_Mask : Type<CPred<"::llvm::isa<::mlir::VectorType>($_self) && "
    "::llvm::cast<::mlir::VectorType>($_self).getRank() == 1 && "
    "::llvm::cast<::mlir::VectorType>($_self).getElementType().isInteger(1)">,
    "a mask of lanes">;

def Warp_AnyOp : Warp_Op<"any", [Pure]> {
  let summary = "whether a mask has a lane";
  let arguments = (ins Warp_Mask:$mask);
  let results = (outs I1:$result);
  let assemblyFormat = "$mask attr-dict `:` type($mask)";
}

def Warp_LaneNumbersOp : Warp_Op<"lane_numbers", [Pure]> {
  let summary = "0, 1, 2, ... in the lanes";
  let results = (outs Warp_LanesOf:$result);
  let assemblyFormat = "attr-dict `:` type($result)";
}

def Warp_BroadcastOp : Warp_Op<"broadcast", [Pure]> {
  let summary = "the same value in all lanes";
  let arguments = (ins AnyType:$value);
  let results = (outs Warp_LanesOf:$result);
  let assemblyFormat = "$value attr-dict `:` type($value) `->` type($result)";
}

def Warp_CombineLanesOp : Warp_Op<"combine_lanes", [Pure]> {
  let summary = "the lanes of a vector combined, halves first";
  let description = [{
    Lane i is combined with lane i + N/2, then the lanes that are left alike.
    `type` is that of a lane, with its sign.
  }];
  let arguments = (ins I32Attr:$kind, TypeAttr:$type, Warp_LanesOf:$value);
  let results = (outs AnyType:$result);
  let assemblyFormat = [{
    $value attr-dict `:` type($value) `->` type($result)
  }];
}

def Warp_EachLaneOp : Warp_Op<"each_lane", [SingleBlock,
                                            RecursiveMemoryEffects]> {
  let summary = "what the lanes of a mask do one after the other";
  let description = [{
    For code that has no form for lanes: calls, output, updates of elements
    whose order counts. The block's arguments are the operands' values in the
    lane. Lanes outside of the mask have no particular results.

    (C1) operands and results have a value per lane; the block has an argument
    for each operand.

    ```mlir
    %r = warp.each_lane %m (%a) {
    ^bb0(%x: f32):
      %y = func.call @f(%x) : (f32) -> f32
      warp.yield %y : f32
    } : vector<16xi1>, vector<16xf32> -> vector<16xf32>
    ```
  }];
  let arguments = (ins Warp_Mask:$mask, Variadic<Warp_LanesOf>:$inputs);
  let results = (outs Variadic<Warp_LanesOf>:$outputs);
  let regions = (region SizedRegion<1>:$body);
  let assemblyFormat = [{
    $mask `(` $inputs `)` attr-dict-with-keyword $body `:` type($mask)
    (`,` type($inputs)^)? (`->` type($outputs)^)?
  }];
  let hasVerifier = 1;
}

def Warp_LaneForm : I32EnumAttr<"LaneForm", "how lanes find their elements", [
    I32EnumAttrCase<"unit", 0>, I32EnumAttrCase<"gather", 1>]> {
  let cppNamespace = "::warp";
}

def Warp_LoadLanesOp : Warp_AccessOp<"load_lanes", "Read", -1> {
  let summary = "an array element for each lane";
  let description = [{
    `unit`: indices are those of the first lane, not negative, and the elements
    of the lanes are `stride` elements apart in the array's last dimension,
    which is packed. `gather`: an index is a value per lane, or the same for
    all.

    (C1) as many indices as the rank. (C2) the results are the flattened
    element, with a value per lane.
  }];
  let arguments = (ins Arg<Warp_AnyArray, "", [MemRead]>:$array,
                       Variadic<AnyType>:$indices, Warp_Mask:$mask,
                       Warp_LaneForm:$form, DenseBoolArrayAttr:$nonNegative,
                       DefaultValuedAttr<I64Attr, "1">:$stride);
  let results = (outs Variadic<Warp_LanesOf>:$components);
  let assemblyFormat = [{
    $form $array `[` $indices `]` `mask` $mask attr-dict `:` type($array) `,`
    `(` type($indices) `)` `,` type($mask) `->` type($components)
  }];
  let hasVerifier = 1;
}

def Warp_StoreLanesOp
    : Warp_AccessOp<"store_lanes", "Write", 0, "std::nullopt", "false",
                    [AttrSizedOperandSegments]> {
  let summary = "writes an array element for each lane";
  let description = [{
    Forms and constraints are those of `warp.load_lanes`. Where lanes meet, the
    last one's value stays.
  }];
  let arguments = (ins Variadic<Warp_LanesOf>:$components,
                       Arg<Warp_AnyArray, "", [MemWrite]>:$array,
                       Variadic<AnyType>:$indices, Warp_Mask:$mask,
                       Warp_LaneForm:$form, DenseBoolArrayAttr:$nonNegative,
                       DefaultValuedAttr<I64Attr, "1">:$stride);
  let assemblyFormat = [{
    $form `(` $components `)` `,` $array `[` $indices `]` `mask` $mask attr-dict
    `:` `(` type($components) `)` `,` type($array) `,` `(` type($indices) `)`
    `,` type($mask)
  }];
  let hasVerifier = 1;
}

def Warp_UpdateLanesOp
    : Warp_AccessOp<"update_lanes", "Update", 0, "getKind()", "true",
                    [AttrSizedOperandSegments]> {
  let summary = "updates an array element for each lane";
  let description = [{
    Lanes do it one after the other, so they may meet. An index is a value per
    lane, or the same for all. Constraints are those of `warp.load_lanes`.
  }];
  let arguments = (ins Warp_AtomicKind:$kind,
                       Variadic<Warp_LanesOf>:$components,
                       Arg<Warp_AnyArray, "", [MemRead, MemWrite]>:$array,
                       Variadic<AnyType>:$indices, Warp_Mask:$mask,
                       DenseBoolArrayAttr:$nonNegative);
  let assemblyFormat = [{
    $kind `(` $components `)` `,` $array `[` $indices `]` `mask` $mask attr-dict
    `:` `(` type($components) `)` `,` type($array) `,` `(` type($indices) `)`
    `,` type($mask)
  }];
  let hasVerifier = 1;
}

//===----------------------------------------------------------------------===//
// Entries
//===----------------------------------------------------------------------===//

def Warp_ParameterOp : Warp_Op<"parameter", [Pure]> {
  let summary = "value at a byte offset of the parameter block";
  let description = [{
    Reads a scalar, or the descriptor of an array. `packed` promises that the
    array lies in row-major order without gaps, so that its strides need not be
    read. `name` is how messages call the value.

    (C1) the offset is not negative. (C2) only an array is `packed`.

    ```mlir
    %x = warp.parameter %block[24] packed {name = "x"}
      : !llvm.ptr -> !warp.array<1 x f32>
    ```
  }];
  let arguments = (ins AnyType:$block, I64Attr:$offset, UnitAttr:$packed,
                       OptionalAttr<StrAttr>:$name);
  let results = (outs AnyType:$result);
  let assemblyFormat = [{
    $block `[` $offset `]` (`packed` $packed^)? attr-dict `:` type($block) `->`
    type($result)
  }];
  let hasVerifier = 1;
}

#endif // WARP_LAUNCH_OPS_TD

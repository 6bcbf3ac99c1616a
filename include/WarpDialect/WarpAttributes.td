//===- WarpAttributes.td - What is known of a launch ---------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A kernel function carries a variant: the kind of launch that it is compiled
// for. Its entry also carries a recipe: how such a launch is to be made. Both
// cross the border to the runtime, see `CompileOptions` and `Code` of
// warp/Compile.h. Arguments that a derivative has and its primal has not are
// described by an attribute each.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_ATTRIBUTES_TD
#define WARP_ATTRIBUTES_TD

include "mlir/IR/AttrTypeBase.td"
include "mlir/IR/EnumAttr.td"
include "WarpDialect.td"

class Warp_Enum<string name, string text, list<I32EnumAttrCase> enumCases>
    : I32EnumAttr<name, text, enumCases> {
  let cppNamespace = "::warp";
  let genSpecializedAttr = 0;
}

class Warp_Attr<string name, string attrMnemonic>
    : AttrDef<Warp_Dialect, name> {
  let mnemonic = attrMnemonic;
  let assemblyFormat = "`<` struct(params) `>`";
}

class Warp_Flag<string value = "false"> : DefaultValuedParameter<"bool", value>;
class Warp_Number<string value> : DefaultValuedParameter<"int64_t", value>;

//===----------------------------------------------------------------------===//
// The kind of launch
//===----------------------------------------------------------------------===//

def Warp_Platform : Warp_Enum<"Platform", "kind of processor", [
    I32EnumAttrCase<"cpu", 0>, I32EnumAttrCase<"cuda", 1>]>;

def Warp_TargetAttr : Warp_Attr<"Target", "target"> {
  let summary = "the processor that code is for";
  let description = [{
    `version` is the GPU architecture, 90 for sm_90; `processor` the name of a
    CPU, empty for the host; `bits` the width of the vectors that a CPU computes
    with at full speed.

    (C1) a GPU has a version and no vectors. (C2) a CPU has none, and vectors
    of 128, 256 or 512 bits.

    ```mlir
    #warp.target<platform = cuda, version = 90>
    ```
  }];
  let parameters = (ins EnumParameter<Warp_Platform>:$platform,
                        Warp_Number<"0">:$version,
                        StringRefParameter<"name of a CPU", "\"\"">:$processor,
                        Warp_Number<"0">:$bits);
  let genVerifyDecl = 1;
  let extraClassDeclaration = [{
    bool isGpu() const { return getPlatform() == ::warp::Platform::cuda; }
    bool has(::warp::Feature feature) const;
    /// Values of a type that one vector holds; 1 on a GPU, whose threads are
    /// the lanes.
    int64_t getLanes(::mlir::Type type) const;
  }];
}

def Warp_Determinism
    : Warp_Enum<"Determinism", "how sums have the same bits in every run", [
    I32EnumAttrCase<"none", 0>, I32EnumAttrCase<"ordered", 1>,
    I32EnumAttrCase<"exact", 2>]>;

def Warp_VariantAttr : Warp_Attr<"Variant", "variant"> {
  let summary = "the kind of launch that code is for";
  let description = [{
    `contiguous`, bit i: argument i is an array packed in row-major order (for a
    GPU one that begins at a multiple of its elements' size or of 16 bytes), or
    an integer that is not negative. `index32`: no array and no launch has 2^31
    elements or more. `flat`: one linear grid axis for all dimensions of a GPU
    launch. `large`: the launch fills the GPU many times over; `under`: it has
    too few threads to fill it, or on a CPU fewer than 16 (scalar code, compiled
    with less effort, where no loop may be long); `narrow`: squares of indices of
    its last two dimensions would not fill; `joinable`: so many blocks in a row
    may be one, and there are enough. `disjoint`: no memory that the launch writes
    overlaps another one. `block`: threads of a GPU block. `threads`: those that
    would share a CPU launch. `min_blocks`:
    fewest blocks that a multiprocessor shall hold, 0 leaves it open. `lanes`:
    threads that are to be lanes of a vector on a CPU; 1 keeps them scalar, 0
    leaves it open. `row`: rows of a CPU launch, of its last dimension, have at
    most so many threads, which lanes are; 0 says nothing.

    (C1) `rank` is 1 to 4. (C2) `block` and `threads` are 1 or more. (C3) `lanes`
    and `row` are 0 or a power of two up to 64. (C4) `joinable` is 1, 2 or 4.

    ```mlir
    #warp.variant<target = <platform = cpu, bits = 512>, rank = 2, debug = true>
    ```
  }];
  let parameters = (ins "::warp::TargetAttr":$target, Warp_Number<"1">:$rank,
                        DefaultValuedParameter<"uint64_t", "0">:$contiguous,
                        Warp_Flag<"true">:$index32, Warp_Flag<>:$flat,
                        Warp_Flag<>:$large, Warp_Flag<>:$under,
                        Warp_Flag<>:$narrow, Warp_Number<"1">:$joinable,
                        Warp_Flag<>:$disjoint,
                        Warp_Number<"256">:$block, Warp_Number<"16">:$threads,
                        Warp_Number<"0">:$min_blocks, Warp_Number<"0">:$lanes,
                        Warp_Number<"0">:$row, Warp_Flag<>:$debug, Warp_Flag<>:$fast_math,
                        DefaultValuedParameter<"::warp::Determinism",
                            "::warp::Determinism::none">:$deterministic);
  let genVerifyDecl = 1;
  let extraClassDeclaration = [{
    /// That of a kernel of which nothing is known but the target.
    static VariantAttr getUnknown(::mlir::MLIRContext *context);
    bool isGpu() const { return getTarget().isGpu(); }
    bool isDeterministic() const {
      return getDeterministic() != ::warp::Determinism::none;
    }
    /// Bit i of `contiguous`.
    bool isContiguous(unsigned argument) const {
      return argument < 64 && (getContiguous() >> argument & 1);
    }
    /// Whether the blocks of a GPU launch are made of full warps.
    bool hasWholeWarps() const;
  }];
}

//===----------------------------------------------------------------------===//
// How to make the launch
//===----------------------------------------------------------------------===//

def Warp_SummedArrayAttr : Warp_Attr<"SummedArray", "summed_array"> {
  let summary = "an array that a launch with exact sums accesses";
  let description = [{
    `width` bits are those of the floats that are summed, 0 if the launch loads
    or stores. The rest is that of `SummedArray` in warp/ExactSums.h.
  }];
  let parameters = (ins Warp_Number<"0">:$width, "int64_t":$descriptor,
                        Warp_Flag<>:$gradient, "int64_t":$element_size,
                        Warp_Number<"1">:$stride_scale);
}

def Warp_CopiedArrayAttr : Warp_Attr<"CopiedArray", "copied_array"> {
  let summary = "an array that workers may have private copies of";
  let description = [{
    The fields are those of `CopiedArray` in warp/PrivateCopies.h.
  }];
  let parameters = (ins "int64_t":$descriptor, Warp_Flag<>:$gradient,
                        "int64_t":$element_size, Warp_Number<"1">:$numbers,
                        Warp_Number<"32">:$width, Warp_Flag<"true">:$floating);
}

def Warp_CopiedAttr : Warp_Attr<"Copied", "copied"> {
  let summary = "the arrays that an exclusive launch may add to in copies";
  let description = [{
    With copies of these for each worker, the code may run on several.
    `plain_time`, `atomic_time`: picoseconds that a launch index is estimated to
    take without atomic instructions, and with them.
  }];
  let parameters = (ins "::mlir::ArrayAttr":$arrays,
                        Warp_Number<"0">:$plain_time,
                        Warp_Number<"0">:$atomic_time);
}

def Warp_RecipeAttr : Warp_Attr<"Recipe", "recipe"> {
  let summary = "how the runtime is to launch an entry";
  let description = [{
    `items`: launch indices that one GPU thread takes; of an exclusive launch,
    the threads of its only block. `rows`: those of them that follow each other
    in the dimension before the last. `tile`: indices of each of the last two
    dimensions that a GPU block takes as a square, 0 without squares. `split`:
    threads of a GPU block that share one index. `joined`: GPU blocks in a row of
    the launch's last dimension of blocks that are one. `facts`: what of the size of a
    launch the code depends on, `SizeFact` of warp/SizeFacts.h as a mask.
    `alternates`: every other launch may run its GPU blocks from the last to the
    first. `exclusive`: one thread runs a CPU launch, one block a GPU launch; `copied`:
    or several workers with copies of these arrays. `cost`: rough operations of
    one thread. `lanes`: threads that are lanes of a vector on a CPU, from
    warp-widen-threads on. `sums`: the arrays with exact sums, then the others;
    their descriptors follow the arguments in the parameter block.
  }];
  let parameters = (ins Warp_Number<"1">:$items, Warp_Number<"1">:$rows,
                        Warp_Number<"0">:$tile, Warp_Number<"1">:$split,
                        Warp_Number<"1">:$joined,
                        Warp_Number<"0">:$facts, Warp_Flag<>:$alternates,
                        Warp_Flag<>:$exclusive,
                        OptionalParameter<"::warp::CopiedAttr">:$copied,
                        Warp_Number<"0">:$cost, Warp_Number<"1">:$lanes,
                        OptionalParameter<"::mlir::ArrayAttr">:$sums);
  let extraClassDeclaration = [{
    /// A launch of which nothing is known.
    static RecipeAttr getUnknown(::mlir::MLIRContext *context);
    RecipeAttr withItems(int64_t items) const;
    RecipeAttr withRows(int64_t rows) const;
    RecipeAttr withTile(int64_t tile) const;
    RecipeAttr withSplit(int64_t split) const;
    RecipeAttr withJoined(int64_t joined) const;
    /// In addition to those that it has.
    RecipeAttr withFacts(int64_t facts) const;
    RecipeAttr withAlternates() const;
    RecipeAttr withExclusive() const;
    RecipeAttr withCopied(::warp::CopiedAttr copied) const;
    RecipeAttr withCost(int64_t cost) const;
    RecipeAttr withLanes(int64_t lanes) const;
    RecipeAttr withSums(::mlir::ArrayAttr sums) const;
    ::llvm::SmallVector<::warp::SummedArrayAttr> getSummedArrays() const;
    /// Descriptors of sums in the parameter block.
    int64_t countSums() const;
  }];
}

//===----------------------------------------------------------------------===//
// How to make an update
//===----------------------------------------------------------------------===//

def Warp_UpdateScope
    : Warp_Enum<"UpdateScope", "threads whose updates become one", [
    I32EnumAttrCase<"thread", 0>, I32EnumAttrCase<"lanes", 1>,
    I32EnumAttrCase<"ring", 2>, I32EnumAttrCase<"group", 3>]>;

def Warp_UpdateAttr : Warp_Attr<"Update", "update"> {
  let summary = "how an atomic update is to be made";
  let description = [{
    What warp-plan-updates decided. `scope`: the threads that make one update
    together. `thread`: each makes its own. `lanes`: those of a vector or warp,
    if they agree on the element. `ring`: in a loop, each lane of a warp begins
    at another iteration, and sums travel from lane to lane. `group`: all of a
    range or block.

    `run`: of `lanes` on a CPU, threads in a row that may be expected to agree;
    0 if all lanes surely do. `sum`: the sum is exact, in integers; where its
    `SumDescriptor` lies in the parameter block (warp/ExactSums.h), -1 if it is
    not.

    ```mlir
    #warp.update<scope = group, sum = 192>
    ```
  }];
  let parameters = (ins DefaultValuedParameter<"::warp::UpdateScope",
                            "::warp::UpdateScope::thread">:$scope,
                        Warp_Number<"0">:$run, Warp_Number<"-1">:$sum);
  let extraClassDeclaration = [{
    bool isExact() const { return getSum() >= 0; }
  }];
}

//===----------------------------------------------------------------------===//
// Arguments of derivatives
//===----------------------------------------------------------------------===//

def Warp_HiddenKind : Warp_Enum<"HiddenKind", "what a hidden argument is", [
    I32EnumAttrCase<"Preserved", 0, "preserved">,
    I32EnumAttrCase<"Saved", 1, "saved">,
    I32EnumAttrCase<"Counters", 2, "counters">,
    I32EnumAttrCase<"Tangent", 3, "tangent">,
    I32EnumAttrCase<"Claims", 4, "claims">,
    I32EnumAttrCase<"Trips", 5, "trips">,
    I32EnumAttrCase<"Offsets", 6, "offsets">,
    I32EnumAttrCase<"Totals", 7, "totals">,
    I32EnumAttrCase<"Tape", 8, "tape">]>;

def Warp_HiddenAttr : Warp_Attr<"Hidden", "hidden"> {
  let summary = "an argument that the primal of a derivative does not have";
  let description = [{
    `leaf` is the number of the array that it is about, -1 without; `direction`
    that of a tangent; `places` the source line that each counter is of. The
    kinds are explained at `HiddenArgument` of warp/Autodiff.h.

    ```mlir
    #warp.hidden<kind = tangent, leaf = 0, direction = 1>
    ```
  }];
  let parameters = (ins EnumParameter<Warp_HiddenKind>:$kind,
                        Warp_Number<"-1">:$leaf, Warp_Number<"0">:$direction,
                        OptionalParameter<"::mlir::ArrayAttr">:$places);
  let builders = [AttrBuilder<(ins "::warp::HiddenKind":$kind,
                                   CArg<"int64_t", "-1">:$leaf,
                                   CArg<"int64_t", "0">:$direction), [{
    return $_get($_ctxt, kind, leaf, direction, ::mlir::ArrayAttr());
  }]>];
}

#endif // WARP_ATTRIBUTES_TD

//===- WarpAttributes.td - What is known of a launch ---------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A kernel function carries a variant: the kind of launch that it is compiled
// for. Its entry also carries a schedule: how such a launch is to be made. Both
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
    launch. `large`: the launch fills the GPU many times over; `underfilled`:
    it has fewer threads than fill the GPU, or on a CPU fewer than 16 (scalar
    code, compiled with less effort, where no loop may be long); `skinny`:
    32 x 32 tiles of the last two dimensions would be mostly empty;
    `max_block_coarsening`: so many neighbouring blocks may be merged without
    leaving multiprocessors idle. `disjoint`: no memory that the launch writes
    overlaps another one. `block`: threads of a GPU block. `threads`: those that
    would share a CPU launch. `min_blocks`:
    fewest blocks that a multiprocessor shall hold, 0 leaves it open. `lanes`:
    threads that are to be lanes of a vector on a CPU; 1 keeps them scalar, 0
    leaves it open. `inner_extent`: upper bound of the extent of the last
    dimension of a CPU launch, whose threads are lanes; 0 leaves it open.

    (C1) `rank` is 1 to 4. (C2) `block` and `threads` are 1 or more. (C3) `lanes`
    and `inner_extent` are 0 or a power of two up to 64. (C4) `max_block_coarsening` is 1, 2 or 4.

    ```mlir
    #warp.variant<target = <platform = cpu, bits = 512>, rank = 2, debug = true>
    ```
  }];
  let parameters = (ins "::warp::TargetAttr":$target, Warp_Number<"1">:$rank,
                        DefaultValuedParameter<"uint64_t", "0">:$contiguous,
                        Warp_Flag<"true">:$index32, Warp_Flag<>:$flat,
                        Warp_Flag<>:$large, Warp_Flag<>:$underfilled,
                        Warp_Flag<>:$skinny, Warp_Number<"1">:$max_block_coarsening,
                        Warp_Flag<>:$disjoint,
                        Warp_Number<"256">:$block, Warp_Number<"16">:$threads,
                        Warp_Number<"0">:$min_blocks, Warp_Number<"0">:$lanes,
                        Warp_Number<"0">:$inner_extent, Warp_Flag<>:$debug, Warp_Flag<>:$fast_math,
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

def Warp_ScheduleAttr : Warp_Attr<"Schedule", "schedule"> {
  let summary = "how the runtime is to launch an entry";
  let description = [{
    `coarsening`: launch indices per GPU thread; `row_coarsening`: those of them
    that follow each other in the dimension before the last. `transpose_tile`:
    side of the square tile, in the last two dimensions, that a GPU block stages
    in shared memory; 0 without. `split_reduction`: threads of a GPU block that
    share one launch index. `block_coarsening`: neighbouring GPU blocks, in the
    dimension before the last, that are merged. `size_facts`: the facts of a
    launch's size that the code depends on, a mask of `SizeFact`
    (warp/SizeFacts.h). `reverse_order`: every other launch may run its GPU
    blocks last to first. `single_block`: threads of the only block of a GPU
    launch, 0 if it has several. `exclusive`: one thread runs a CPU launch;
    `copied`: or several workers with copies of these arrays. `cost`: rough operations of
    one thread. `lanes`: threads that are lanes of a vector on a CPU, from
    warp-widen-threads on. `sums`: the arrays with exact sums, then the others;
    their descriptors follow the arguments in the parameter block.
  }];
  let parameters = (ins Warp_Number<"1">:$coarsening,
                        Warp_Number<"1">:$row_coarsening,
                        Warp_Number<"0">:$transpose_tile,
                        Warp_Number<"1">:$split_reduction,
                        Warp_Number<"1">:$block_coarsening,
                        Warp_Number<"0">:$size_facts,
                        Warp_Flag<>:$reverse_order, Warp_Flag<>:$exclusive,
                        Warp_Number<"0">:$single_block,
                        OptionalParameter<"::warp::CopiedAttr">:$copied,
                        Warp_Number<"0">:$cost, Warp_Number<"1">:$lanes,
                        OptionalParameter<"::mlir::ArrayAttr">:$sums);
  let extraClassDeclaration = [{
    /// A launch of which nothing is known.
    static ScheduleAttr getUnknown(::mlir::MLIRContext *context);
    ScheduleAttr withCoarsening(int64_t coarsening) const;
    ScheduleAttr withRowCoarsening(int64_t coarsening) const;
    ScheduleAttr withTransposeTile(int64_t side) const;
    ScheduleAttr withSplitReduction(int64_t parts) const;
    ScheduleAttr withBlockCoarsening(int64_t coarsening) const;
    /// In addition to those that it has.
    ScheduleAttr withSizeFacts(int64_t facts) const;
    ScheduleAttr withReverseOrder(bool value) const;
    ScheduleAttr withExclusive(bool value) const;
    ScheduleAttr withSingleBlock(int64_t threads) const;
    ScheduleAttr withCopied(::warp::CopiedAttr copied) const;
    ScheduleAttr withCost(int64_t cost) const;
    ScheduleAttr withLanes(int64_t lanes) const;
    ScheduleAttr withSums(::mlir::ArrayAttr sums) const;
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

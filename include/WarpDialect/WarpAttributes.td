//===- WarpAttributes.td - Attributes of launches ------------*- tablegen -*-=//
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
include "Launch.td"
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

def Warp_TargetAttr : Warp_Attr<"Target", "target"> {
  let summary = "the processor that code is for";
  let description = [{
    `name` is a target of lib/Targets: "cpu", "cpu:skylake-avx512", "sm_90",
    "gfx90a". `bits` is the width of the vectors that a CPU computes with at
    full speed.

    (C1) there is a target of that name. (C2) a GPU has no vectors, a CPU such of
    128, 256 or 512 bits.

    ```mlir
    #warp.target<name = "sm_90">
    ```
  }];
  let parameters = (ins StringRefParameter<"name of the target">:$name,
                        Warp_Number<"0">:$bits);
  let builders = [AttrBuilder<(ins "::llvm::StringRef":$name), [{
    return $_get($_ctxt, name, ::warp::getVectorBits(name));
  }]>];
  let genVerifyDecl = 1;
  let extraClassDeclaration = [{
    const ::warp::TargetInfo &getInfo() const;
    /// Values of a type that one vector holds; 1 on a GPU, whose threads are
    /// the lanes.
    int64_t getLanes(::mlir::Type type) const;
  }];
}

/// An attribute whose parameters are the launch facts that it has, in the order
/// of their records' names, behind the `first`. Their accessors, `with` and the
/// verifier come from the records of Launch.td.
class Warp_FactsAttr<string name, string attrMnemonic, list<LaunchFact> all,
                     dag first> : Warp_Attr<name, attrMnemonic> {
  list<LaunchFact> facts = !filter(fact, all, fact.inAttribute);
  list<AttrOrTypeParameter> types = !foreach(fact, facts,
      !if(fact.type.isOptional,
          !cast<AttrOrTypeParameter>(
              OptionalParameter<fact.type.attributeType, fact.summary>),
          !cast<AttrOrTypeParameter>(
              DefaultValuedParameter<fact.type.attributeType, fact.type.initial,
                                     fact.summary>)));
  let parameters = !con(first, !dag(ins, types,
                                    !foreach(fact, facts, fact.name)));
}

def Warp_VariantAttr : Warp_FactsAttr<"Variant", "variant",
    !instances<VariantFact>(), (ins "::warp::TargetAttr":$target)> {
  let summary = "the kind of launch that code is for";
  let description = [{
    The variant facts of Launch.td, but for those that passes have no use for.
    Each number lies in the range of its record.

    ```mlir
    #warp.variant<target = <name = "cpu", bits = 512>, rank = 2, debug = true>
    ```
  }];
  let genVerifyDecl = 1;
  let extraClassDeclaration = [{
#define GET_LAUNCH_VARIANT_ACCESSORS
#include "warp/LaunchContract.h.inc"
    /// The default of each fact.
    static VariantAttr getDefault(::warp::TargetAttr target);
    /// The variant of a kernel without one: nothing is known of its launches.
    static VariantAttr getUnknown(::mlir::MLIRContext *context);
    bool isDeterministic() const { return getDeterministic(); }
    /// Deterministic sums that do not depend on an order.
    bool hasExactSums() const { return getDeterministic() && !getOrdered(); }
    /// Updates whose result is used are made in the order of the threads.
    bool keepsThreadOrder() const {
      return getThreadOrder() && !getDeterministic() &&
             getTarget().getBits() != 0;
    }
    /// Bits of `packed` and `non_negative`.
    bool isPacked(unsigned argument) const {
      return argument < 64 && (getPacked() >> argument & 1);
    }
    bool isNonNegative(unsigned argument) const {
      return argument < 64 && (getNonNegative() >> argument & 1);
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
                        Warp_Number<"32">:$width, Warp_Flag<"true">:$floating,
                        Warp_Flag<>:$is_unsigned, Warp_Number<"0">:$kind);
}

def Warp_CopiedAttr : Warp_Attr<"Copied", "copied"> {
  let summary = "the arrays that an exclusive launch may update in copies";
  let description = [{
    With copies of these for each worker, the code may run on several.
    `plain_time`, `atomic_time`: picoseconds that a launch index is estimated to
    take without atomic instructions, and with them.
  }];
  let parameters = (ins "::mlir::ArrayAttr":$arrays,
                        Warp_Number<"0">:$plain_time,
                        Warp_Number<"0">:$atomic_time);
}

def Warp_ScheduleAttr : Warp_FactsAttr<"Schedule", "schedule",
    !instances<ScheduleFact>(), (ins)> {
  let summary = "how the runtime is to launch an entry";
  let description = [{
    The schedule facts of Launch.td, but for those that are read off the finished
    code.

    ```mlir
    #warp.schedule<coarsening = 8, row_coarsening = 2>
    ```
  }];
  let genVerifyDecl = 1;
  let extraClassDeclaration = [{
#define GET_LAUNCH_SCHEDULE_ACCESSORS
#include "warp/LaunchContract.h.inc"
    /// A launch of which nothing is known: the default of each fact.
    static ScheduleAttr getDefault(::mlir::MLIRContext *context);
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
    The decision of warp-plan-updates. `scope`: the threads that make one update
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
    I32EnumAttrCase<"Tape", 7, "tape">]>;

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

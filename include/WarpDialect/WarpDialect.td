//===- WarpDialect.td - The warp dialect ---------------------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DIALECT_TD
#define WARP_DIALECT_TD

include "mlir/IR/DialectBase.td"
include "mlir/IR/OpBase.td"

def Warp_Dialect : Dialect {
  let name = "warp";
  let cppNamespace = "::warp";
  let summary = "values and accesses of a kernel, one thread at a time";
  let description = [{
    A function marked `warp.kernel` describes what one thread of a launch does.
    Scalars carry their signedness (`si32`, `ui32`, `f32`; `i1` is a boolean);
    vectors, matrices, quaternions, transforms and structs are values, not
    memory; arrays are descriptors through which a thread loads and stores.
    Control flow is `scf` with carried values.

    Most operations are builtins: one TableGen record gives the operation, its
    Python name and overloads, its documentation and its lowering. Their
    operands and results are checked against the overloads of the record.
  }];
  let useDefaultTypePrinterParser = 1;
  let useDefaultAttributePrinterParser = 1;
  let hasCanonicalizer = 1;
  let hasConstantMaterializer = 1;
  let hasOperationAttrVerify = 1;
  let extraClassDeclaration = [{
    void registerAttributes();
    void registerTypes();
    void registerOps();
  }];
  let dependentDialects = ["::mlir::scf::SCFDialect",
                           "::mlir::func::FuncDialect"];
}

/// An operation that thread IR may hold, see warp-verify-thread.
def Warp_ThreadPhase : NativeOpTrait<"ThreadPhase"> {
  let cppNamespace = "::warp";
}

class Warp_Op<string mnemonic, list<Trait> traits = []>
    : Op<Warp_Dialect, mnemonic, traits>;

#endif // WARP_DIALECT_TD

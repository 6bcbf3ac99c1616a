//===- WarpInterfaces.td - Interfaces of operations ----------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_INTERFACES_TD
#define WARP_INTERFACES_TD

include "mlir/IR/OpBase.td"

def Warp_BuiltinOpInterface : OpInterface<"BuiltinOp"> {
  let cppNamespace = "::warp";
  let description = [{
    An operation that a registry record describes.
  }];
  let methods = [
    StaticInterfaceMethod<"The record.", "const ::warp::BuiltinSpec &",
                          "getSpec">
  ];
}

def Warp_AccessOpInterface : OpInterface<"AccessOp"> {
  let cppNamespace = "::warp";
  let description = [{
    An operation that reads, writes or updates one element of an array. Passes
    ask this interface; only the lowering of an operation knows it by name.
  }];
  let methods = [
    InterfaceMethod<"The array that the operation names.", "::mlir::Value",
                    "getArray">,
    InterfaceMethod<"The operand that is the array.", "::mlir::OpOperand &",
                    "getArrayMutable">,
    InterfaceMethod<"One index per dimension of that array.",
                    "::mlir::OperandRange", "getIndices">,
    InterfaceMethod<"Values that are stored, or combined with the element.",
                    "::mlir::OperandRange", "getWritten">,
    InterfaceMethod<"What the operation returns of the element: before an "
                    "update, it is the old value.",
                    "::mlir::ResultRange", "getRead", (ins), [{}], [{
      return $_op->getResults();
    }]>,
    InterfaceMethod<"What happens to the element.", "::warp::AccessEffect",
                    "getEffect">,
    InterfaceMethod<"How an update combines; none for what is no update, and "
                    "for a compare and exchange.",
                    "std::optional<::warp::AtomicKind>", "getCombination">,
    InterfaceMethod<"No other thread's access comes between the parts of this "
                    "update.", "bool", "isAtomic">,
    InterfaceMethod<"Threads or lanes for which the access takes place; null "
                    "for all.", "::mlir::Value", "getMask", (ins), [{}], [{
      return {};
    }]>,
  ];
  let extraSharedClassDeclaration = [{
    bool mayRead() { return $_op.getEffect() != ::warp::AccessEffect::Write; }
    bool mayWrite() { return $_op.getEffect() != ::warp::AccessEffect::Read; }
    bool isUpdate() { return $_op.getEffect() == ::warp::AccessEffect::Update; }
  }];
}

def Warp_ArrayViewOpInterface : OpInterface<"ArrayViewOp"> {
  let cppNamespace = "::warp";
  let description = [{
    An operation whose only result is an array in the memory of another one.
  }];
  let methods = [
    InterfaceMethod<"The other array.", "::mlir::Value", "getArray">,
  ];
}

#endif // WARP_INTERFACES_TD

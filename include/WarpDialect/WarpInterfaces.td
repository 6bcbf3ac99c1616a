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

#endif // WARP_INTERFACES_TD

//===- WarpDerivativeOps.td - Derivatives within a kernel ----*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DERIVATIVE_OPS_TD
#define WARP_DERIVATIVE_OPS_TD

include "mlir/IR/SymbolInterfaces.td"
include "WarpTypes.td"

def Warp_VjpOp : Warp_Op<"vjp",
    [AttrSizedOperandSegments,
     DeclareOpInterfaceMethods<SymbolUserOpInterface>]> {
  let summary = "cotangents of a function's arguments";
  let description = [{
    The map from cotangents of a function's results to those of its arguments:
    one cotangent per argument that is a float or a composite of floats. Nothing
    that the function writes is written. With `arrays` the gradients of its
    array arguments are added to, else these arrays are constants.

    A function whose `warp.vjp` names another has that one as its adjoint; of
    its results, the last `warp.residuals` have no cotangents.

    (C1) the callee is a function, and the arguments have its types. (C2) one
    cotangent per result of floats, of its type. (C3) one result per argument
    of floats, of its type.

    ```mlir
    %dx = warp.vjp @f(%x, %n) of (%dy) : (f32, si32), (f32) -> (f32)
    ```
  }];
  let arguments = (ins FlatSymbolRefAttr:$callee, Variadic<AnyType>:$arguments,
                       Variadic<AnyType>:$cotangents, UnitAttr:$arrays);
  let results = (outs Variadic<AnyType>:$results);
  let assemblyFormat = [{
    $callee `(` $arguments `)` `of` `(` $cotangents `)` attr-dict `:`
    `(` type($arguments) `)` `,` `(` type($cotangents) `)` `->`
    `(` type($results) `)`
  }];
}

def Warp_JvpOp : Warp_Op<"jvp",
    [AttrSizedOperandSegments,
     DeclareOpInterfaceMethods<SymbolUserOpInterface>]> {
  let summary = "tangents of a function's results";
  let description = [{
    One tangent per result that is a float or a composite of floats, from
    tangents of the first arguments that are; the others are constants. Array
    arguments are constants, too.

    (C1) the callee is a function, and the arguments have its types. (C2) at
    most one tangent per argument of floats, in order and of its type. (C3) one
    result per result of floats, of its type.

    ```mlir
    %dy = warp.jvp @f(%x, %n) of (%dx) : (f32, si32), (f32) -> (f32)
    ```
  }];
  let arguments = (ins FlatSymbolRefAttr:$callee, Variadic<AnyType>:$arguments,
                       Variadic<AnyType>:$tangents);
  let results = (outs Variadic<AnyType>:$results);
  let assemblyFormat = [{
    $callee `(` $arguments `)` `of` `(` $tangents `)` attr-dict `:`
    `(` type($arguments) `)` `,` `(` type($tangents) `)` `->`
    `(` type($results) `)`
  }];
}

#endif // WARP_DERIVATIVE_OPS_TD

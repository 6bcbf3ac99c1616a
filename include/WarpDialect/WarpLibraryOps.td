//===- WarpLibraryOps.td - Calls of the device library -------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// What kernels do in C++ of ours, and the memory that it describes. These
// operations have a header of their own: few passes know them.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIBRARY_OPS_TD
#define WARP_LIBRARY_OPS_TD

include "mlir/Interfaces/SideEffectInterfaces.td"
include "WarpTypes.td"

def Warp_LibraryCallOp : Warp_Op<"library_call",
    [Warp_ThreadPhase, NoMemoryEffect]> {
  let summary = "calls a function of the device library";
  let description = [{
    The function reads what geometry handles describe. Nothing writes that while
    a kernel runs, so for passes it reads nothing. Lanes of a CPU call it one by
    one. Which functions there are says lib/Dialect/LibraryOps.cpp.

    (C1) the library has the function. (C2) operands and results are its
    scalars, of either sign.

    ```mlir
    %face, %u, %v = warp.library_call "warp_mesh_closest"(%id, %x, %y, %z, %d)
      : (ui64, f32, f32, f32, f32) -> (si32, f32, f32)
    ```
  }];
  let arguments = (ins StrAttr:$callee, Variadic<AnyType>:$args);
  let results = (outs Variadic<AnyType>:$results);
  let assemblyFormat = [{
    $callee `(` $args `)` attr-dict `:` functional-type($args, $results)
  }];
  let hasVerifier = 1;
}

def Warp_ArrayAtOp : Warp_Op<"array_at", [Pure, Warp_ThreadPhase]> {
  let summary = "packed array at an address";
  let description = [{
    (C1) the address has 64 bits. (C2) there are as many integer extents of 32
    bits as the array has dimensions. Where arrays are descriptors of LLVM's,
    the result is one.

    ```mlir
    %a = warp.array_at %address[%n], 4 : ui64, si32 -> !warp.array<1 x f32>
    ```
  }];
  let arguments = (ins AnyInteger:$address, Variadic<AnyInteger>:$extents,
                       I64Attr:$elementSize);
  let results = (outs AnyType:$array);
  let assemblyFormat = [{
    $address `[` $extents `]` `,` $elementSize attr-dict `:` type($address) `,`
    type($extents) `->` type($array)
  }];
  let hasVerifier = 1;
}

#endif // WARP_LIBRARY_OPS_TD

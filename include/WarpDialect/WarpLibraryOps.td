//===- WarpLibraryOps.td - Calls of the device library -------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Calls of functions in C++. In a header of its own: few passes know it.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIBRARY_OPS_TD
#define WARP_LIBRARY_OPS_TD

include "mlir/Interfaces/SideEffectInterfaces.td"
include "WarpTypes.td"

def Warp_LibraryCallOp : Warp_Op<"library_call",
    [Warp_ThreadPhase, DeclareOpInterfaceMethods<MemoryEffectsOpInterface>]> {
  let summary = "calls a function of the device library";
  let description = [{
    One with results reads what geometry handles describe. Nothing writes that
    while a kernel runs, so for passes it reads nothing. One without results
    changes the memory at addresses that it gets. Lanes of a CPU call it one by
    one, or together with vectors, by a name that ends in `_lanes`, where it has
    such a form. Functions.td has the records of the functions.

    (C1) the library has the function, or its name begins with `warp_native_`:
    a snippet of the program, compiled by Clang. (C2) operands and results are
    its scalars, of either sign; of a form for lanes vectors of them, but for the
    first operands, which lanes share. (C3) a snippet takes and gives scalars; one whose
    name begins with `warp_native_memory_` reads and writes memory, too.

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

#endif // WARP_LIBRARY_OPS_TD

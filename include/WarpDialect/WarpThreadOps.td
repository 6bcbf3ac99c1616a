//===- WarpThreadOps.td - Array accesses of thread IR --------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// In thread IR a composite is a list of scalars, and one operation still reads
// or writes all of it: later passes can't separate what belongs together.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_THREAD_OPS_TD
#define WARP_THREAD_OPS_TD

include "WarpArrayOps.td"

def Warp_LoadComponentsOp
    : Warp_AccessOp<"load_components", "Read", -1, "std::nullopt", "false",
                    [Warp_ThreadPhase]> {
  let summary = "all components of an array element";
  let description = [{
    (C1) as many indices as the rank. (C2) the results are the flattened
    element, signless.

    ```mlir
    %x, %y, %z = warp.load_components %a[%i]
      : !warp.array<1 x !warp.vec<3 x f32>>, i32 -> f32, f32, f32
    ```
  }];
  let arguments = (ins Arg<Warp_AnyArray, "", [MemRead]>:$array,
                       Variadic<AnySignlessInteger>:$indices);
  let results = (outs Variadic<AnyType>:$components);
  let assemblyFormat = [{
    $array `[` $indices `]` attr-dict `:` type($array) `,` type($indices)
    `->` type($components)
  }];
  let hasVerifier = 1;
}

def Warp_StoreComponentsOp
    : Warp_AccessOp<"store_components", "Write", 0, "std::nullopt", "false",
                    [Warp_ThreadPhase, AttrSizedOperandSegments]> {
  let summary = "writes all components of an array element";
  let description = [{
    (C1) as many indices as the rank. (C2) the operands are the flattened
    element, signless.

    ```mlir
    warp.store_components (%x, %y, %z), %a[%i]
      : (f32, f32, f32), !warp.array<1 x !warp.vec<3 x f32>>, i32
    ```
  }];
  let arguments = (ins Variadic<AnyType>:$components,
                       Arg<Warp_AnyArray, "", [MemWrite]>:$array,
                       Variadic<AnySignlessInteger>:$indices);
  let assemblyFormat = [{
    `(` $components `)` `,` $array `[` $indices `]` attr-dict `:`
    `(` type($components) `)` `,` type($array) `,` type($indices)
  }];
  let hasVerifier = 1;
}

def Warp_AtomicComponentsOp
    : Warp_AccessOp<"atomic_components", "Update", 0, "getKind()", "true",
                    [Warp_ThreadPhase, AttrSizedOperandSegments]> {
  let summary = "atomic update of each component of an array element";
  let description = [{
    (C1) as many indices as the rank. (C2) operands and results are the
    flattened element, signless.
  }];
  let arguments = (ins Warp_AtomicKind:$kind, Variadic<AnyType>:$components,
                       Arg<Warp_AnyArray, "", [MemRead, MemWrite]>:$array,
                       Variadic<AnySignlessInteger>:$indices);
  let results = (outs Variadic<AnyType>:$old);
  let assemblyFormat = [{
    $kind `(` $components `)` `,` $array `[` $indices `]` attr-dict `:`
    `(` type($components) `)` `,` type($array) `,` type($indices) `->`
    type($old)
  }];
  let hasVerifier = 1;
}

def Warp_AddressOp : Warp_Op<"address", [Pure]> {
  let summary = "the address of an array element";
  let description = [{
    (C1) as many indices as the rank. In a debugging launch it is 0, and the
    error is recorded, if an index is out of bounds.

    ```mlir
    %p = warp.address %a[%i] : !warp.array<1 x f32>, i32
    ```
  }];
  let arguments = (ins Warp_AnyArray:$array,
                       Variadic<AnySignlessInteger>:$indices);
  let results = (outs I64:$address);
  let assemblyFormat = [{
    $array `[` $indices `]` attr-dict `:` type($array) `,` type($indices)
  }];
  let hasVerifier = 1;
}

#endif // WARP_THREAD_OPS_TD

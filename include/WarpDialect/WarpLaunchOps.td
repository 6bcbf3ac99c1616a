//===- WarpLaunchOps.td - Between thread IR and LLVM ---------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// What an entry function, made by warp-lower-launch, adds to thread IR.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LAUNCH_OPS_TD
#define WARP_LAUNCH_OPS_TD

include "WarpTypes.td"

def Warp_ParameterOp : Warp_Op<"parameter", [Pure]> {
  let summary = "value at a byte offset of the parameter block";
  let description = [{
    Reads a scalar, or the descriptor of an array. `packed` promises that the
    array lies in row-major order without gaps, so that its strides need not be
    read. `name` is how messages call the value.

    (C1) the offset is not negative. (C2) only an array is `packed`.

    ```mlir
    %x = warp.parameter %block[24] packed {name = "x"}
      : !llvm.ptr -> !warp.array<1 x f32>
    ```
  }];
  let arguments = (ins AnyType:$block, I64Attr:$offset, UnitAttr:$packed,
                       OptionalAttr<StrAttr>:$name);
  let results = (outs AnyType:$result);
  let assemblyFormat = [{
    $block `[` $offset `]` (`packed` $packed^)? attr-dict `:` type($block) `->`
    type($result)
  }];
  let hasVerifier = 1;
}

#endif // WARP_LAUNCH_OPS_TD

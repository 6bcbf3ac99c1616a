//===- WarpScratchOps.td - Memory of one thread --------------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A few values that a thread keeps at places known only at run time: what an
// adjoint loop remembers of the iterations it is going to reverse. The size is
// a constant, so that a thread needs neither a heap nor a bound on trips.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_SCRATCH_OPS_TD
#define WARP_SCRATCH_OPS_TD

include "mlir/Interfaces/SideEffectInterfaces.td"
include "WarpTypes.td"

def Warp_ScratchType : Warp_Type<"Scratch", "scratch"> {
  let summary = "memory of one thread for a fixed number of values";
  let description = [{
    (C1) there are 1 to 65536 slots. (C2) the element type is a scalar or a
    composite.
  }];
  let parameters = (ins "int64_t":$slots, "::mlir::Type":$elementType);
  let assemblyFormat = "`<` $slots `x` custom<Nested>($elementType) `>`";
}

def Warp_AnyScratch : Type<CPred<"::llvm::isa<::warp::ScratchType>($_self)">,
                           "memory of a thread">;

def Warp_ScratchOp : Warp_Op<"scratch", [Warp_ThreadPhase]> {
  let summary = "memory of this thread";
  let description = [{
    Slots hold no particular value before the first store. One operation is one
    piece of memory, however often control passes it, so that a loop does not
    make a thread's memory grow.

    ```mlir
    %s = warp.scratch : !warp.scratch<8 x f32>
    ```
  }];
  let results = (outs Res<Warp_AnyScratch, "", [MemAlloc]>:$result);
  let assemblyFormat = "attr-dict `:` type($result)";
}

def Warp_ScratchLoadOp : Warp_Op<"scratch_load", [Warp_ThreadPhase]> {
  let summary = "value in a slot of the thread's memory";
  let description = [{
    The index is in range. Where slots hold a value per lane, it may differ from
    lane to lane.

    (C1) the result has the element type. (C2) the index is an integer, or with
    lanes one for each.

    ```mlir
    %x = warp.scratch_load %s[%i] : !warp.scratch<8 x f32>, si32 -> f32
    ```
  }];
  let arguments = (ins Arg<Warp_AnyScratch, "", [MemRead]>:$scratch,
                       AnyType:$index);
  let results = (outs AnyType:$result);
  let assemblyFormat = [{
    $scratch `[` $index `]` attr-dict `:` type($scratch) `,` type($index) `->`
    type($result)
  }];
  let hasVerifier = 1;
}

def Warp_ScratchStoreOp : Warp_Op<"scratch_store", [Warp_ThreadPhase]> {
  let summary = "sets a slot of the thread's memory";
  let description = [{
    The index is in range. Where slots hold a value per lane, it may differ from
    lane to lane.

    (C1) the value has the element type. (C2) the index is an integer, or with
    lanes one for each.

    ```mlir
    warp.scratch_store %x, %s[%i] : f32, !warp.scratch<8 x f32>, si32
    ```
  }];
  let arguments = (ins AnyType:$value,
                       Arg<Warp_AnyScratch, "", [MemWrite]>:$scratch,
                       AnyType:$index);
  let assemblyFormat = [{
    $value `,` $scratch `[` $index `]` attr-dict `:` type($value) `,`
    type($scratch) `,` type($index)
  }];
  let hasVerifier = 1;
}

#endif // WARP_SCRATCH_OPS_TD

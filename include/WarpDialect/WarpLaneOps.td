//===- WarpLaneOps.td - Threads that meet ------------------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// In a header of its own: few passes know it.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LANE_OPS_TD
#define WARP_LANE_OPS_TD

include "mlir/Interfaces/InferTypeOpInterface.td"
include "mlir/Interfaces/SideEffectInterfaces.td"
include "WarpTypes.td"

def Warp_AgreeOp : Warp_Op<"agree", [Warp_ThreadPhase,
                                     SameOperandsAndResultType]> {
  let summary = "one of the numbers of the lanes that are here";
  let description = [{
    `hint` if a lane has that number, else the least. All lanes of a vector get
    the same; a thread alone gets its own.

    ```mlir
    %u = warp.agree %place, %expected : i32
    %here = arith.cmpi eq, %place, %u : i32
    ```
  }];
  let arguments = (ins AnySignlessInteger:$own, AnySignlessInteger:$hint);
  let results = (outs AnySignlessInteger:$result);
  let assemblyFormat = "$own `,` $hint attr-dict `:` type($result)";
}

def Warp_MostTripsOp : Warp_Op<"most_trips",
    [Warp_ThreadPhase, NoMemoryEffect, SameOperandsAndResultType]> {
  let summary = "the most trips of the lanes that are here";
  let description = [{
    A reversed loop that runs for so many iterations, and skips those that a
    thread did not make, has all lanes in the same iteration. A thread alone
    gets its own number.

    ```mlir
    %n = warp.most_trips %trips : i64
    ```
  }];
  let arguments = (ins AnySignlessInteger:$own);
  let results = (outs AnySignlessInteger:$result);
  let assemblyFormat = "$own attr-dict `:` type($result)";
}

#endif // WARP_LANE_OPS_TD

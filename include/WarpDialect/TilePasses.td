//===- TilePasses.td - Passes about tiles --------------------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Between warp-specialize and warp-lower-composites, in this order. All leave a
// kernel without tiles as it is.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TILE_PASSES_TD
#define WARP_TILE_PASSES_TD

include "mlir/Pass/PassBase.td"

class WarpTilePass<string flag> : Pass<flag, "::mlir::ModuleOp">;

def MaskThreads : WarpTilePass<"warp-mask-threads"> {
  let summary = "Let threads that have returned take part in what a block does";
  let description = [{
    If a branch on what differs between threads is a return from the kernel
    (`warp.stays` names the side of those that stay), and on a GPU where the last
    block lacks threads (`warp.ragged`): they do nothing by themselves any more,
    and give zero to tiles.

    ```
    scf.if %returns {
    } else {
      %x = warp.load %a[%i] : ...
      %t = warp.tile_from_threads %x : f32 -> !warp.tile<64 x f32>
      warp.tile_store %t, %b[%c0] : ...
    } {warp.stays = "else"}
    // ==>
    scf.if %any_stays {
      %x = scf.if %stays -> f32 { warp.load %a[%i] : ... } else { 0 }
      %t = warp.tile_from_threads %x : f32 -> !warp.tile<64 x f32>
      warp.tile_store %t, %b[%c0] : ...
    }
    ```
  }];
  let dependentDialects = ["::warp::WarpDialect", "::mlir::arith::ArithDialect",
                           "::mlir::scf::SCFDialect"];
}

def CheckTiles : WarpTilePass<"warp-check-tiles"> {
  let summary = "Check what a block of threads does together";
  let description = [{
    Operations on whole tiles stand where all threads of the block come by: not
    under a condition that differs from thread to thread. A kernel without tiles
    is left as it is, here and in the following passes.
  }];
}

def ScalarizeTiles : WarpTilePass<"warp-scalarize-tiles"> {
  let summary = "Make a kernel without tiles of one whose tiles have one element";
  let description = [{
    For blocks of one thread on a CPU, but in debug kernels. If there is a form
    without tiles for all operations of the kernel, its threads are independent
    from here on.

    ```
    %t = warp.tile_from_threads %x : f32 -> !warp.tile<1 x f32>
    %s = warp.tile_reduce add %t : !warp.tile<1 x f32> -> !warp.tile<1 x f32>
    %old = warp.tile_atomic add %s, %a[%i] : ...
    // ==>
    // %inside: 0 <= %i < extent of %a
    scf.if %inside {
      %old = warp.atomic add %x, %a[%i] : f32, ...
    }
    ```
  }];
  let dependentDialects = ["::warp::WarpDialect", "::mlir::arith::ArithDialect",
                           "::mlir::scf::SCFDialect"];
}

def FormLaneLoops : WarpTilePass<"warp-form-lane-loops"> {
  let summary = "Let one thread of a CPU do what the threads of a block do";
  let description = [{
    For blocks of more than one thread on a CPU. Operations on tiles stay; what
    threads do between them becomes loops over threads, and values that live
    longer than such a loop tiles. The first thread of a block does it all, and
    blocks have one thread from here on.

    ```
    %x = warp.load %a[%tid] : ...
    %t = warp.tile_from_threads %x : f32 -> !warp.tile<64 x f32>
    // ==>
    %t = scf.for %i = 0 to 64 iter_args(%u = %empty) {
      %x = warp.load %a[%first + %i] : ...
      %v = warp.tile_set assign %x, %u[%i] : ...
      scf.yield %v
    }
    ```
  }];
  let dependentDialects = ["::warp::WarpDialect", "::mlir::scf::SCFDialect"];
}

def FuseTiles : WarpTilePass<"warp-fuse-tiles"> {
  let summary = "Make one function of elements of those that follow each other";
  let description = [{
    A `tile_map` without effects whose results only one other `tile_map` of the
    same block uses becomes part of that, so that its elements are never stored.

    ```
    %b = warp.tile_map(%a) { sin } : ...
    %c = warp.tile_map(%b, %a) { add } : ...
    // ==>
    %c = warp.tile_map(%a) { add of sin and itself } : ...
    ```

    A product that is only added to a tile of 32 or 64 bits adds to it itself:
    `add(%c, matmul(%a, %b))` is `matmul(%a, %b) add %c`.
  }];
  let dependentDialects = ["::warp::WarpDialect"];
}

def PlaceTiles : WarpTilePass<"warp-place-tiles"> {
  let summary = "Decide which tiles are kept and which are computed where used";
  let description = [{
    A tile that is cheap to compute element by element, has one use and does not
    read what is overwritten before that use is `inlined`: nothing of it is ever
    stored. Others are in shared memory. Tiles that loops and branches
    carry are in memory, and an operation that only replaces elements works in
    place if nobody needs what it replaces. On a GPU, registers of threads hold
    `accumulators` of products, elements that are `distributed` over their owners,
    and single elements that are `replicated`; loads into registers stand before
    what the block computes, operations that the device library has functions for
    get a `warp.function`, and loops that load factors of products are pipelined
    (`warp.stages`). `#warp.tile_layout` says all of it.

    ```
    %b = warp.tile_map(%a) {...} : (!warp.tile<64 x f32>) -> !warp.tile<64 x f32>
    // ==>
    %b = warp.tile_map(%a) {...} {warp.layout = #warp.tile_layout<storage = inlined>} : ...
    ```
  }];
  let dependentDialects = ["::warp::WarpDialect", "::mlir::scf::SCFDialect"];
}

def PlanTileMemory : WarpTilePass<"warp-plan-tile-memory"> {
  let summary = "Give tiles their offset in shared memory";
  let description = [{
    Tiles whose lifetimes do not overlap share memory. Largest first, each gets
    the lowest place that is free for as long as it lives. More memory than the
    target's blocks have is an error that names the largest tiles.

    ```
    %b = warp.tile_sort(%a) {...} : ...
    // ==>
    %b = warp.tile_sort(%a) {..., offset = 1024} : ...
    ```
  }];
}

def PlaceBarriers : WarpTilePass<"warp-place-barriers"> {
  let summary = "Make threads of a block wait for each other where they have to";
  let description = [{
    A barrier stands before an operation on memory, of tiles or of arrays, that
    another thread has accessed since the last barrier, unless both only read.
    An element that the same thread accesses both times needs none. On a GPU the
    accesses before a branch enter it and those of its sides leave it; a loop
    begins and ends its turns with a barrier if there is anything to wait for. On
    a CPU a block is one thread.
  }];
  let dependentDialects = ["::warp::WarpDialect"];
}

def LowerTiles : WarpTilePass<"warp-lower-tiles"> {
  let summary = "Expand tiles into loops over elements";
  let description = [{
    A tile in memory becomes a packed array at an offset of shared memory; an
    operation on it loops that the threads of the block share: thread t takes the
    elements t, t + B, ... of B threads.
  }];
  let dependentDialects = ["::mlir::arith::ArithDialect",
                           "::mlir::LLVM::LLVMDialect",
                           "::mlir::scf::SCFDialect", "::warp::WarpDialect"];
}

#endif // WARP_TILE_PASSES_TD

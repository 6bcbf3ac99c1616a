//===- Passes.td - Passes of the warp dialect ----------------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// In the order in which a kernel meets them. All run on a module that holds
// one kernel.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_PASSES_TD
#define WARP_PASSES_TD

include "mlir/Pass/PassBase.td"

class WarpPass<string flag> : Pass<flag, "::mlir::ModuleOp">;

//===----------------------------------------------------------------------===//
// Phase `warp`
//===----------------------------------------------------------------------===//

def VerifyWarp : WarpPass<"warp-verify-warp"> {
  let summary = "Check that a module is what front-end IR may be";
  let description = [{
    One function carries `warp.kernel` and returns nothing; every operation is
    of the warp, scf, func or builtin dialect.
  }];
}

//===----------------------------------------------------------------------===//
// Derivatives, between `warp` and `thread`
//===----------------------------------------------------------------------===//

def ResolveDerivatives : WarpPass<"warp-resolve-derivatives"> {
  let summary = "Replace warp.vjp and warp.jvp by calls of functions";
  let description = [{
    Functions without a derivative of their own are differentiated here.
    Derivatives of functions that are merely called are dropped, unless the
    kernel is about to be differentiated, and so are functions without a use.
    For forward mode they need not be complete: replays are dropped.

    ```mlir
    func.func private @square(%x: f32) -> f32 {
      %y = warp.mul(%x, %x) : (f32, f32) -> f32
      return %y : f32
    }
    func.func @f(%x: f32, %dy: f32) -> f32 {
      %dx = warp.vjp @square(%x) of (%dy) : (f32), (f32) -> (f32)
      return %dx : f32
    }
    // ==>
    func.func @f(%x: f32, %dy: f32) -> f32 {
      %dx = func.call @square_vjp(%x, %dy) : (f32, f32) -> f32
      return %dx : f32
    }
    func.func private @square_vjp(%x: f32, %dy: f32) -> f32 {
      %a = warp.mul(%dy, %x) : (f32, f32) -> f32
      %b = warp.mul(%x, %dy) : (f32, f32) -> f32
      %s = warp.add(%a, %b) : (f32, f32) -> f32
      return %s : f32
    }
    ```
  }];
  let options = [
    Option<"keepDerivatives", "keep-derivatives", "bool", "false",
           "Keep functions that are derivatives of functions in use">,
    Option<"forward", "forward", "bool", "false",
           "Functions that are kept are for forward mode">,
    Option<"singular", "singular", "std::string", "\"pinned\"",
           "Derivatives where there is none: pinned, strict or report">,
  ];
  let dependentDialects = ["::mlir::func::FuncDialect", "::warp::WarpDialect"];
}

def ExpandBuiltins : WarpPass<"warp-expand-builtins"> {
  let summary = "Replace builtins without a derivative of their own";
  let description = [{
    A builtin whose record says that it has a derivative, but no formula for
    one, becomes the scalar builtins that its lowering computes with. Short loops
    whose counters are all that indices of composites are made of are written
    out before: a derivative has nothing to keep for them.

    ```
    %r = warp.skew(%v) : (!warp.vec<3 x f32>) -> !warp.mat<3x3 x f32>
    // ==>
    %x = warp.extract %v[%c0] : !warp.vec<3 x f32>, si32 -> f32
    // %y, %z alike
    %nz = warp.neg(%z) : (f32) -> f32
    // %nx, %ny alike
    %r = warp.construct(%0, %nz, %y, %z, %0, %nx, %ny, %x, %0) : ...
    ```
  }];
  let dependentDialects = [
    "::mlir::arith::ArithDialect", "::mlir::math::MathDialect",
    "::mlir::scf::SCFDialect", "::mlir::LLVM::LLVMDialect",
    "::warp::WarpDialect"];
}

def FlattenStructs : WarpPass<"warp-flatten-structs"> {
  let summary = "Replace struct values by their fields";
  let description = [{
    Arguments stay structs; nothing else is one afterwards, and elements of
    arrays of structs are accessed field by field.

    ```
    %p = warp.load %a[%i] : !warp.array<1 x !P>, si32 -> !P
    %m = warp.struct_get %p["m"] : !P -> f32
    // ==>
    %v = warp.component_view %a[] field "m"
    %m = warp.load %v[%i] : !warp.array<1 x f32>, si32 -> f32
    ```
  }];
  let dependentDialects = ["::warp::WarpDialect"];
}

def ForwardStores : WarpPass<"warp-forward-stores"> {
  let summary = "Use what a thread stored or loaded instead of loading it again";
  let description = [{
    Threads do not see each other's writes between two accesses of the same
    element by one thread. An element that a counted loop updates becomes a
    value that the loop carries. An atomic whose result is used becomes a load
    and a store where the element belongs to one thread.

    ```mlir
    warp.store %x, %y[%i] : f32, !warp.array<1 x f32>, i32
    %v = warp.load %y[%i] : !warp.array<1 x f32>, i32 -> f32
    // ==>
    warp.store %x, %y[%i] : f32, !warp.array<1 x f32>, i32   // and %x, not %v
    ```
  }];
  let options = [
    Option<"unique", "unique", "bool", "true", "No two arrays overlap">,
  ];
  let dependentDialects = ["::mlir::arith::ArithDialect",
                           "::mlir::scf::SCFDialect", "::warp::WarpDialect"];
}

def DifferentiateKernel : WarpPass<"warp-differentiate-kernel"> {
  let summary = "Replace the kernel by its derivative";
  let description = [{
    The adjoint of a kernel has the same parameters, and hidden ones after them
    for what cannot be computed again. It runs after the kernel and turns
    gradients of the arrays written into gradients of the arrays read.
    Structs must have been flattened and builtins without a rule expanded.

    ```mlir
    %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
    %p = warp.sin(%v) : (f32) -> f32
    warp.store %p, %y[%i] : f32, !warp.array<1 x f32>, si32
    // ==>
    %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
    %g = warp.load %dy[%i] : !warp.array<1 x f32>, si32 -> f32
    warp.store %zero, %dy[%i] : f32, !warp.array<1 x f32>, si32
    %c = warp.cos(%v) : (f32) -> f32
    %h = warp.mul(%g, %c) : (f32, f32) -> f32
    warp.accumulate %h, %dx[%i] {unique = 1} : f32, !warp.array<1 x f32>, si32
    ```
  }];
  let options = [
    Option<"mode", "mode", "std::string", "\"reverse\"",
           "reverse: the adjoint; forward: the kernel with tangents">,
    Option<"active", "active", "std::string", "\"\"",
           "One of 0 and 1 per array, in the order of the arguments: whether "
           "it has a gradient">,
    Option<"singular", "singular", "std::string", "\"pinned\"",
           "Derivatives where there is none: pinned, strict or report">,
    Option<"width", "width", "unsigned", "1",
           "How many tangents the forward mode carries beside a value">,
    Option<"unique", "unique", "bool", "true", "No two arrays overlap">,
    Option<"maxLocalTape", "max-local-tape", "int64_t", "256",
           "Bytes that a thread may keep of a loop with a known length, where "
           "checkpoints take less">,
    Option<"tape", "tape", "std::string", "\"checkpoints\"",
           "How longer loops recover values: checkpoints, or global "
           "for memory that the runtime allocates">,
    Option<"dumpRecovery", "dump-recovery", "bool", "false",
           "Say how each value that a loop carries is recovered">,
  ];
  let dependentDialects = ["::mlir::scf::SCFDialect",
                           "::mlir::func::FuncDialect", "::warp::WarpDialect"];
}

def InlinePullbacks : WarpPass<"warp-inline-pullbacks"> {
  let summary = "Inline functions with derivatives, and those derivatives";
  let description = [{
    Settles which array of the kernel they add gradients to; what they add to
    one without a gradient is erased.

    ```mlir
    %row = warp.view %a[%i] : !warp.array<2 x f32>, si32 -> !warp.array<1 x f32>
    %g = warp.grad %row : !warp.array<1 x f32> -> !warp.array<1 x f32>
    // ==>
    %ga = warp.grad %a : !warp.array<2 x f32> -> !warp.array<2 x f32>
    %g = warp.view %ga[%i] : !warp.array<2 x f32>, si32 -> !warp.array<1 x f32>
    ```
  }];
  let options = [
    Option<"active", "active", "std::string", "\"\"",
           "One of 0 and 1 per array, in the order of the arguments: whether "
           "it has a gradient">,
  ];
  let dependentDialects = ["::mlir::func::FuncDialect", "::warp::WarpDialect"];
}

def SimplifyAdjoint : WarpPass<"warp-simplify-adjoint"> {
  let summary = "Move sums into one element out of loops, erase dead code";
  let description = [{
    Also erases what loops carry from one iteration to the next to no effect.
    Loop-invariant code must have been moved.

    ```mlir
    scf.for %k = %zero to %n step %one : i32 {
      warp.accumulate %v, %dx[%i] : f32, !warp.array<1 x f32>, si32
    }
    // ==>
    %s = scf.for %k = %zero to %n step %one iter_args(%t = %none) -> f32 : i32 {
      %u = warp.add(%t, %v) : (f32, f32) -> f32
      scf.yield %u : f32
    }
    %any = arith.cmpi slt, %zero, %n : i32
    scf.if %any {
      warp.accumulate %s, %dx[%i] : f32, !warp.array<1 x f32>, si32
    }
    ```
  }];
  let dependentDialects = ["::mlir::arith::ArithDialect",
                           "::mlir::scf::SCFDialect", "::warp::WarpDialect"];
}

def CleanUpAdjoint : WarpPass<"warp-clean-up-adjoint"> {
  let summary = "Settle what an adjoint needs, once dead code is gone";
  let description = [{
    Reports values that the adjoint needs and cannot have, drops hidden
    parameters without a use, merges sums into one element, and notes which
    arrays the adjoint reads.
  }];
}

def GatherSums : WarpPass<"warp-gather-sums"> {
  let summary = "Take sums over neighbours out of an adjoint, to gather them";
  let description = [{
    If the threads of an adjoint add to gradients around their own element,
    one more function takes that over: each of its threads collects what others
    would have added to one element, without atomics. It is to run before the
    adjoint, in a launch that is larger by `warp.halo` in each dimension, and
    has the extents of the adjoint's launch as further parameters. A module
    without such sums stays as it is.

    An index may be clamped to bounds that are the same in all threads, or be
    the rest of a division by such a period. Such an addition is split: threads
    between the bounds are gathered, and those at a border keep an atomic
    addition in the adjoint.

    ```
    func.func @k_adjoint(%x, %y) attributes {warp.kernel} {
      %v = warp.load %dy[%i]
      warp.accumulate %v, %dx[%i]
      warp.accumulate %v, %dx[%i_1]        // %i + 1
    }
    // ==>
    func.func @k_adjoint_sums(%x, %y, %n) attributes {warp.halo = [1]} {
      %s = scf.if %is_less                 // %i < %n
        // warp.load %dy[%i], or 0
      %t = scf.if %is_positive             // %i >= 1
        // warp.load %dy[%i - 1], or 0
      %u = warp.add(%s, %t)
      scf.if %is_any                       // %is_less or %is_positive
        warp.accumulate %u, %dx[%i] {unique = 1}
    }
    ```
  }];
  let dependentDialects = ["::mlir::arith::ArithDialect",
                           "::mlir::func::FuncDialect",
                           "::mlir::scf::SCFDialect", "::warp::WarpDialect"];
}

//===----------------------------------------------------------------------===//
// Phase `thread`
//===----------------------------------------------------------------------===//

def Specialize : WarpPass<"warp-specialize"> {
  let summary = "Attach the facts of a launch and fold what they decide";
  let description = [{
    The kernel gets a `#warp.variant` from the options of the pass, which are
    those of `CompileOptions` (lib/Transforms/Variant.cpp lists them): a `key`
    or `key=value` each. Without options, a variant that it has remains. Thread
    indices of dimensions that the launch does not have become zero, and
    assertions disappear unless the launch is a debugging one.
    `warp.accumulate` becomes an atomic update, or a plain one where its indices
    are unique.

    ```mlir
    %i, %j = warp.tid : si32, si32
    // ==> with rank=1
    %i = warp.tid : si32
    %j = warp.constant 0 : si32
    ```
  }];
  let dependentDialects = ["::warp::WarpDialect"];
}

def LowerComposites : WarpPass<"warp-lower-composites"> {
  let summary = "Take composites and structs apart into scalars";
  let description = [{
    Integers lose their sign, builtins become arith and math operations, and
    an access to an array element reads or writes all its components.

    ```mlir
    %s = warp.dot(%a, %b) : (!warp.vec<2 x f32>, !warp.vec<2 x f32>) -> f32
    // ==>
    %0 = arith.mulf %a0, %b0 : f32
    %1 = arith.mulf %a1, %b1 : f32
    %s = arith.addf %0, %1 : f32
    ```
  }];
  let dependentDialects = [
    "::mlir::arith::ArithDialect", "::mlir::math::MathDialect",
    "::mlir::scf::SCFDialect", "::mlir::func::FuncDialect",
    "::mlir::LLVM::LLVMDialect", "::warp::WarpDialect"];
}

def VerifyThread : WarpPass<"warp-verify-thread"> {
  let summary = "Check that a module is thread IR";
  let description = [{
    One kernel function is left; values are signless scalars and arrays, and
    no builtin or composite operation remains.
  }];
}

//===----------------------------------------------------------------------===//
// Phase `launch`
//===----------------------------------------------------------------------===//

def FuseMultiplyAdd : WarpPass<"warp-fuse-multiply-add"> {
  let summary = "Make a product and a sum of it one operation";
  let description = [{
    The products that are rounded are settled here, before any schedule, so that
    scalar code, lanes and debugging launches have the same bits. A product with
    one use is fused with the sum that uses it, the left one of two. Nothing is
    fused that is marked `warp.exact`.

    ```mlir
    %p = arith.mulf %a, %b : f32
    %s = arith.addf %p, %c : f32
    // ==>
    %s = math.fma %a, %b, %c : f32
    ```
  }];
  let dependentDialects = ["::mlir::arith::ArithDialect",
                           "::mlir::math::MathDialect"];
}

def FormLaunch : WarpPass<"warp-form-launch"> {
  let summary = "Make the body of a kernel the region of its threads";
  let description = [{
    Begins phase `launch`. The promises of the launch about arguments become
    attributes of them.

    ```
    func.func @f(%x: !warp.array<1 x f32>) attributes {warp.kernel} {
      %i = warp.tid : i32
      // body
    // ==>
    func.func @f(%x: !warp.array<1 x f32> {warp.packed}) {
      warp.group {
        warp.threads {
        ^bb0(%i: i32):
          // body
    ```
  }];
  let dependentDialects = ["::mlir::arith::ArithDialect", "::warp::WarpDialect"];
}

def PlanUpdates : WarpPass<"warp-plan-updates"> {
  let summary = "Decide how each atomic update is made, and by which threads";
  let description = [{
    Each update gets a `#warp.update`: whether it is made by each thread, by the
    lanes of a vector or warp together, in a ring of lanes, or once for a whole
    group; and whether its sum is exact, as those of floats are in a
    deterministic launch where the kernel sees nothing else of an array. The
    schedule then lists arrays with such sums, and all others that are accessed.

    If atomics remain on the CPU, and so few threads would share the launch
    that one thread without atomic instructions is faster, the kernel gets an
    exclusive schedule: it runs on one thread and updates elements plainly. In a
    deterministic launch so does every kernel with atomics whose order would
    show, sums that are exact aside; on a GPU the launch has a single block, of
    one thread if its updates cannot be combined.

    If all atomics that remain add numbers to arrays, or gradients, that the
    kernel does nothing else to, and arrays are disjoint, the schedule lists those
    arrays: the code runs on several threads if each has copies of them.

    Short loops over elements that all threads share are unrolled.

    ```mlir
    %old = warp.atomic_components add(%x), %sum[%c0]
        : (f32), !warp.array<1 x f32>, i32 -> f32
    // ==>
    %old = warp.atomic_components add(%x), %sum[%c0]
        {warp.update = #warp.update<scope = group>}
        : (f32), !warp.array<1 x f32>, i32 -> f32
    ```
  }];
  let dependentDialects = [
    "::mlir::arith::ArithDialect", "::mlir::scf::SCFDialect"];
}

def CombineOverGroups : WarpPass<"warp-combine-over-groups"> {
  let summary = "Combine updates of one element over a group of threads";
  let description = [{
    An update of the scope `group` becomes a value that the threads yield, which
    is combined over the group and published once.

    ```
    warp.threads {
      %old = warp.atomic_components add(%x), %sum[%c0] : ...
    }
    // ==>
    %s = warp.threads kinds = [add] {
      warp.yield %x : f32
    } : f32
    warp.once {
      %old = warp.atomic_components add(%s), %sum[%c0] : ...
    }
    ```
  }];
  let dependentDialects = [
    "::mlir::arith::ArithDialect", "::mlir::scf::SCFDialect",
    "::warp::WarpDialect"];
}

def WidenThreads : WarpPass<"warp-widen-threads"> {
  let summary = "Make threads the lanes of vectors on a CPU";
  let description = [{
    Values that differ from thread to thread become vectors, control flow that
    does becomes masks. Threads stay scalar where lanes cannot be right or do
    not pay, and in a debugging launch.

    ```
    ^bb0(%i: i32):
      %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
      %s = arith.addf %v, %v : f32
    // ==>
    ^bb0(%i: i32, %live: vector<16xi1>):
      %v = warp.load_lanes unit %x[%i] mask %live : ... -> vector<16xf32>
      %s = arith.addf %v, %v : vector<16xf32>
    ```
  }];
  let dependentDialects = [
    "::mlir::arith::ArithDialect", "::mlir::scf::SCFDialect",
    "::warp::WarpDialect"];
}

def VerifyLaunch : WarpPass<"warp-verify-launch"> {
  let summary = "Check that a module is launch IR";
  let description = [{
    The kernel function is one `warp.group`; what has effects stands in its
    `warp.threads` or in `warp.once`; values are signless scalars, arrays, or
    vectors of scalars; and of the LLVM dialect there are only calls of
    intrinsics, which convert numbers.
  }];
}

//===----------------------------------------------------------------------===//
// Facts about values, for people
//===----------------------------------------------------------------------===//

def PrintVariance : WarpPass<"warp-print-variance"> {
  let summary = "Print how the values of a kernel vary over its threads";
  let description = [{
    A line for each value: it is the same for all threads of the launch, or for
    the lanes of a vector, or grows by a constant step from thread to thread, or
    varies in another way. A line for each branch and loop: whether lanes may
    part there. Takes thread and launch IR, and leaves it as it is.

    ```mlir
    %i = warp.tid : i32
    %j = arith.addi %i, %i : i32
    // prints
    //   %0 = warp.tid: step 1
    //   %1 = arith.addi: step 2
    ```
  }];
}

def FoldZeroArguments : WarpPass<"warp-fold-zero-arguments"> {
  let summary = "Leave out loops and branches of arguments that are zero";
  let description = [{
    In a variant with `zeros`, loops without iterations and branches that are
    not taken go; the products that they used keep their rounding, so results
    have the same bits. In others `switches` of the schedule names the arguments
    that would leave out a tenth of the kernel. On CPUs the first element of an
    array that the kernel only reads counts, too.

    ```mlir
    %s = scf.for %k = %c0 to %n step %c1 iter_args(%a = %x) -> (f32) : i32 {
      %v = warp.load %p[%k] : !warp.array<1 x f32>, i32 -> f32
      %t = arith.addf %a, %v : f32
      scf.yield %t : f32
    }
    warp.store %s, %y[%i] : f32, !warp.array<1 x f32>, i32
    // ==> %n is zero
    warp.store %x, %y[%i] : f32, !warp.array<1 x f32>, i32
    ```
  }];
}

def CheckVariance : WarpPass<"warp-check-variance"> {
  let summary = "Test what is known of the values of a kernel while it runs";
  let description = [{
    Takes thread IR of a kernel with an argument `warp_claims`, an array of
    64-bit integers, and leaves any other as it is. Each fact that
    warp-print-variance says of a value is tested behind it; element 0 of the
    array counts what did not hold, element 1 is the number of the last such
    claim, and the 2^17 elements from 8 on, zero at first, are a table for
    claims about several threads. A debugging launch has these tests if the
    kernel has that argument.

    ```
    %j = arith.addi %i, %c1 : i32
    ==>
    %j = arith.addi %i, %c1 : i32
    // ... and if i + 1 is another number, or negative:
    warp.store_components (%more), %warp_claims[%c0] : ...
    ```
  }];
  let dependentDialects = ["::mlir::arith::ArithDialect",
                           "::mlir::scf::SCFDialect"];
}

//===----------------------------------------------------------------------===//
// Phase `gpu`: an entry in structured control flow, on both targets
//===----------------------------------------------------------------------===//

def ApplySchedules : WarpPass<"warp-apply-schedules"> {
  let summary = "Rewrite a kernel for one kind of launch on a GPU";
  let description = [{
    Applies the schedules of one stage that keep what the kernel computes and
    pay for the launch (lib/Transforms/Schedules, docs/schedules.md), and sets
    their fields of `#warp.schedule`. Runs once per stage: `tiles` merges
    blocks; `threads` maps launch indices to the grid, so that the body of
    `warp.threads` has no indices; `updates` and `loads` rewrite loops of the
    entry.

    ```
    warp.threads {
    ^bb0(%i: i32):
      // body
    // ==> stage threads, without coarsening
    warp.threads {
      %n = warp.launch_extent 0 : i32
      // %i = block * block size + thread, %inside = %i < %n
      scf.if %inside {
        // body
    ```
  }];
  let options = [
    Option<"stage", "stage", "::warp::ScheduleStage",
           "::warp::ScheduleStage::threads", "Schedules to apply", [{
             ::llvm::cl::values(
               clEnumValN(::warp::ScheduleStage::tiles, "tiles",
                          "Operations on tiles"),
               clEnumValN(::warp::ScheduleStage::threads, "threads",
                          "Threads of a group"),
               clEnumValN(::warp::ScheduleStage::updates, "updates",
                          "Loops with atomic updates"),
               clEnumValN(::warp::ScheduleStage::loads, "loads",
                          "Loops with uniform loads"))
           }]>,
  ];
  let dependentDialects = [
    "::mlir::arith::ArithDialect", "::mlir::scf::SCFDialect",
    "::mlir::LLVM::LLVMDialect", "::warp::WarpDialect"];
}

def EmitEntry : WarpPass<"warp-emit-entry"> {
  let summary = "Turn the group of threads into the entry of a launch";
  let description = [{
    The entry reads its arguments from the parameter block. On the CPU it runs
    the threads of a range of linear indices, row by row, with an inner loop
    over the last dimension; on the GPU it is one thread, mapped to the grid.

    ```
    warp.group {
      warp.threads {
      ^bb0(%i: i32):
        // body
    // ==>
    llvm.func @f(%block: !llvm.ptr, %begin: i64, %end: i64) {
      %x = warp.parameter %block[24] : !llvm.ptr -> !warp.array<1 x f32>
      scf.for %n = %begin to %end step %one {
        %i = arith.trunci %n : i64 to i32
        // body
    ```
  }];
  let dependentDialects = [
    "::mlir::arith::ArithDialect", "::mlir::scf::SCFDialect",
    "::mlir::LLVM::LLVMDialect", "::warp::WarpDialect"];
}

def LowerLanes : WarpPass<"warp-lower-lanes"> {
  let summary = "Turn what lanes do together into operations on vectors";
  let description = [{
    Code for full vectors, whose mask is a constant, is simplified first. An
    operation is done lane by lane becomes a loop over the lanes, with operands
    and results in memory.

    ```mlir
    %any = warp.any %m : vector<16xi1>
    // ==>
    %any = "llvm.intr.vector.reduce.or"(%m) : (vector<16xi1>) -> i1
    ```
  }];
  let dependentDialects = [
    "::mlir::arith::ArithDialect", "::mlir::scf::SCFDialect",
    "::mlir::LLVM::LLVMDialect"];
}

def CombineOverWarps : WarpPass<"warp-combine-over-warps"> {
  let summary = "Combine updates of one element over the threads of a warp";
  let description = [{
    On a GPU, an update of the scope `lanes`, whose address the threads of a
    warp share in one iteration of a loop or one row of the launch, becomes one
    update by the first lane, of what shuffles have combined, where all lanes come to it
    together. For an element with several components each lane gets a share,
    which the first of those that have the same one updates.

    ```
    %old = warp.atomic_components add(%x), %row[%i] : ...
    // ==>
    scf.if %together {
      // %s: %x of all lanes
      scf.if %is_first_lane {
        %old = warp.atomic_components add(%s), %row[%i] : ...
      }
    } else {
      %old = warp.atomic_components add(%x), %row[%i] : ...
    }
    ```
  }];
  let dependentDialects = [
    "::mlir::arith::ArithDialect", "::mlir::scf::SCFDialect",
    "::mlir::LLVM::LLVMDialect"];
}

def LowerSums : WarpPass<"warp-lower-sums"> {
  let summary = "Add to exact sums by integers";
  let description = [{
    A float is a whole multiple of the least subnormal one. Its digits are
    added to those of the sum, which the runtime keeps beside the array and
    rounds after the launch.

    ```mlir
    %old = warp.atomic_components add(%x), %sum[%j]
        {warp.update = #warp.update<sum = 192>}
        : (f32), !warp.array<1 x f32>, i32 -> f32
    // ==>
    %p = warp.address %sum[%j] : !warp.array<1 x f32>, i32
    // %number: of the element, by %p
    llvm.call @warp_add_exactly_f32(%digits, %touched, %count, %number, %x)
        : (!llvm.ptr, !llvm.ptr, i64, i64, f32) -> ()
    ```
  }];
  let dependentDialects = [
    "::mlir::arith::ArithDialect", "::mlir::scf::SCFDialect",
    "::mlir::LLVM::LLVMDialect", "::warp::WarpDialect"];
}

def UnrollLoops : WarpPass<"warp-unroll-loops"> {
  let summary = "Copy the bodies of a GPU's small loops";
  let description = [{
    A counted loop that loads and computes is marked for LLVM to copy its body.
    In front of a loop with a condition, which computes only, goes one that runs
    several iterations and asks for all of their conditions at once.

    ```
    %r = scf.while (%s = %init) {        // %c from %s
      scf.condition(%c) %s
    } do { ... }                         // f
    // ==>
    %t:2 = scf.while (%s = %init) {      // %c, %c1 from %s, f(%s)
      %all = arith.andi %c, %c1
      scf.condition(%all) %s, %s2        // f(f(%s))
    } do { ... scf.yield %s2 }
    %r = scf.while (%s = %t#0) {         // as before
    ```
  }];
  let dependentDialects = [
    "::mlir::arith::ArithDialect", "::mlir::scf::SCFDialect",
    "::mlir::LLVM::LLVMDialect"];
}

def OrderAccesses : WarpPass<"warp-order-accesses"> {
  let summary = "Load first and store last";
  let description = [{
    Between barriers, calls and loops that write, the stores of a thread sink
    below its loads, and loads rise above its arithmetic, where their arrays
    cannot overlap (`disjoint`). An element that is loaded twice is loaded
    once.

    ```mlir
    %g = warp.load_components %dy[%i] : !warp.array<1 x f32>, i32 -> f32
    warp.store_components (%zero), %dy[%i] : (f32), !warp.array<1 x f32>, i32
    %s = math.cos %v : f32
    %h = warp.load_components %dx[%i] : !warp.array<1 x f32>, i32 -> f32
    // ==> where arrays are disjoint
    %g = warp.load_components %dy[%i] : !warp.array<1 x f32>, i32 -> f32
    %h = warp.load_components %dx[%i] : !warp.array<1 x f32>, i32 -> f32
    %s = math.cos %v : f32
    warp.store_components (%zero), %dy[%i] : (f32), !warp.array<1 x f32>, i32
    ```
  }];
}

def LowerArrays : WarpPass<"warp-lower-arrays"> {
  let summary = "Turn arrays into pointers, extents and strides";
  let description = [{
    An array becomes a struct of the data pointer, its extents and its strides
    in bytes. Accesses to the components of one element stay adjacent. Indices
    that may be negative are wrapped; in a debugging launch every access is
    checked.

    ```mlir
    %v = warp.load_components %a[%i] : !warp.array<1 x f32>, i32 -> f32
    // ==>
    %0 = llvm.extractvalue %a[0] : !llvm.struct<(ptr, i32, i64)>
    %1 = arith.extsi %i : i32 to i64
    %2 = llvm.getelementptr %0[%1] : (!llvm.ptr, i64) -> !llvm.ptr, f32
    %v = llvm.load %2 : !llvm.ptr -> f32
    ```
  }];
  let dependentDialects = [
    "::mlir::arith::ArithDialect", "::mlir::scf::SCFDialect",
    "::mlir::LLVM::LLVMDialect"];
}

def ExpandRoots : WarpPass<"warp-expand-roots"> {
  let summary = "Compute a GPU's square roots without branches";
  let description = [{
    Roots of f32 are correctly rounded, reciprocals of roots within 1 ulp.

    ```mlir
    %one = arith.constant 1.0 : f32
    %s = math.sqrt %x : f32
    %r = arith.divf %one, %s : f32
    // ==>
    %y = llvm.call_intrinsic "llvm.nvvm.rsqrt.approx.f"(%x) : (f32) -> f32
    // %r = %y + %y/2 (1 - %x %y %y), or %y
    ```
  }];
  let dependentDialects = [
    "::mlir::arith::ArithDialect", "::mlir::math::MathDialect",
    "::mlir::LLVM::LLVMDialect"];
}

def LowerMath : WarpPass<"warp-lower-math"> {
  let summary = "Call the target's math library";
  let description = [{
    Operations that a processor has stay as they are; the others become calls:
    of libdevice on the GPU, of our device library on the CPU, which has functions
    of vectors too. On the GPU, too, sines and cosines of floats are ours: those
    of one angle are one call.

    ```mlir
    %y = math.erf %x : f32
    // ==> on a GPU
    %y = llvm.call @__nv_erff(%x) : (f32) -> f32
    ```
  }];
  let dependentDialects = [
    "::mlir::arith::ArithDialect", "::mlir::LLVM::LLVMDialect"];
}

def FormGpuModule : WarpPass<"warp-form-gpu-module"> {
  let summary = "Make the entry of a GPU launch a kernel of the gpu dialect";
  let description = [{
    All functions and variables move to a `gpu.module`, the entry becomes its
    `gpu.func kernel`, and the variables of a block become workgroup buffers of
    the kernel. An entry for the CPU stays as it is.

    ```
    llvm.mlir.global internal @sums_0() {addr_space = 3 : i32}
        : !llvm.array<32 x f32>
    llvm.func @f(%block: !llvm.ptr) {
      %p = llvm.mlir.addressof @sums_0 : !llvm.ptr<3>
    // ==>
    gpu.module @f {
      gpu.func @f(%block: !llvm.ptr)
          workgroup(%sums: memref<32xf32, #gpu.address_space<workgroup>>)
          kernel {
        // %p: where %sums begins
    ```
  }];
  let dependentDialects = [
    "::mlir::arith::ArithDialect", "::mlir::gpu::GPUDialect",
    "::mlir::LLVM::LLVMDialect", "::mlir::memref::MemRefDialect"];
}

def VerifyGpu : WarpPass<"warp-verify-gpu"> {
  let summary = "Check that a module is an entry in structured control flow";
  let description = [{
    No operation of the warp dialect is left, and a kernel for a GPU is in a
    `gpu.module`.
  }];
}

//===----------------------------------------------------------------------===//
// Phase `llvm`
//===----------------------------------------------------------------------===//

def ConvertToLLVM : WarpPass<"warp-convert-to-llvm"> {
  let summary = "Convert what is left to the LLVM dialect";
  let description = [{
    A kernel of the `gpu` dialect becomes one of NVIDIA's on the way, and moves
    out of its `gpu.module`.

    ```
    gpu.module @f {
      gpu.func @f(%block: !llvm.ptr) kernel {
        %i = gpu.thread_id x
    // ==>
    llvm.func @f(%block: !llvm.ptr) attributes {nvvm.kernel} {
      %t = nvvm.read.ptx.sreg.tid.x : i32
      %i = llvm.sext %t : i32 to i64
    ```
  }];
  let dependentDialects = ["::mlir::LLVM::LLVMDialect",
                           "::mlir::cf::ControlFlowDialect"];
}

def VerifyLLVM : WarpPass<"warp-verify-llvm"> {
  let summary = "Check that only the LLVM dialect is left";
}

#endif // WARP_PASSES_TD

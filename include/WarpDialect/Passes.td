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
    %dx = warp.vjp @f(%x) of(%dy) : (f32), (f32) -> (f32)
    // ==>
    %dx = func.call @f_vjp(%x, %dy) : (f32, f32) -> f32
    ```
  }];
  let options = [
    Option<"keepDerivatives", "keep-derivatives", "bool", "false",
           "Keep functions that are derivatives of functions in use">,
    Option<"forward", "forward", "bool", "false",
           "Those that are kept are for forward mode">,
    Option<"singular", "singular", "std::string", "\"pinned\"",
           "Derivatives where there is none: pinned, strict or report">,
  ];
  let dependentDialects = ["::mlir::func::FuncDialect", "::warp::WarpDialect"];
}

def ExpandBuiltins : WarpPass<"warp-expand-builtins"> {
  let summary = "Replace builtins without a derivative of their own";
  let description = [{
    A builtin whose record says that it has a derivative, but no formula for
    one, becomes the scalar builtins that its lowering computes with.

    ```mlir
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

    ```mlir
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
    value that the loop carries.

    ```mlir
    warp.store %x, %y[%i]
    %v = warp.load %y[%i]
    // ==>
    warp.store %x, %y[%i]      // and %x instead of %v
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
    %v = warp.load %x[%i]
    %p = warp.sin(%v)
    warp.store %p, %y[%i]
    // ==>
    %v = warp.load %x[%i]
    %g = warp.load %dy[%i]
    warp.store %zero, %dy[%i]
    %c = warp.cos(%v)
    %h = warp.mul(%g, %c)
    warp.accumulate %h, %dx[%i] {unique = 1}
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
           "Bytes that a thread may keep of a loop with a known length">,
    Option<"tape", "tape", "std::string", "\"checkpoints\"",
           "How longer loops have what they need again: checkpoints, or global "
           "for memory that the runtime allocates">,
    Option<"dumpRecovery", "dump-recovery", "bool", "false",
           "Say how each value that a loop carries is had again">,
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
    %row = warp.view %a[%i]
    %g = warp.grad %row
    // ==>
    %ga = warp.grad %a
    %g = warp.view %ga[%i]
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
    scf.for %k = %zero to %n step %one {
      warp.accumulate %v, %dx[%i]
    }
    // ==>
    %s = scf.for %k = %zero to %n step %one iter_args(%t = %none) {
      %u = warp.add(%t, %v)
      scf.yield %u
    }
    %any = arith.cmpi slt, %zero, %n
    scf.if %any {
      warp.accumulate %s, %dx[%i]
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
    Where the threads of an adjoint add to gradients around their own element,
    one more function takes that over: each of its threads collects what others
    would have added to one element, without atomics. It is to run before the
    adjoint, in a launch that is larger by `warp.halo` in each dimension, and
    has the extents of the adjoint's launch as further parameters. A module
    without such sums stays as it is.

    ```mlir
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
// Phase `llvm`
//===----------------------------------------------------------------------===//

def SumExactly : WarpPass<"warp-sum-exactly"> {
  let summary = "Choose the sums of floats that are exact in this launch";
  let description = [{
    In a deterministic launch: marks updates that add floats to an array of
    which the kernel sees nothing else. Their sums will be exact, and so do not
    depend on the order of updates. The kernel gets a list of arrays: those
    with such sums, then all others that it accesses.

    ```mlir
    %old = warp.atomic_components add (%x), %sum[%j] : ...
    // ==>
    %old = warp.atomic_components add (%x), %sum[%j] {warp.sum = 192} : ...
    ```
  }];
}

def LowerLaunch : WarpPass<"warp-lower-launch"> {
  let summary = "Turn the kernel function into the entry of a launch";
  let description = [{
    The entry reads its arguments from the parameter block. On the CPU it runs
    the threads of a range of linear indices, row by row, with an inner loop
    over the last dimension; on the GPU it is one thread.

    ```mlir
    func.func @f(%x: !warp.array<1 x f32>) attributes {warp.kernel} {
      %i = warp.tid : i32
      // body
    // ==>
    func.func @f(%block: !llvm.ptr, %begin: i64, %end: i64) {
      %x = warp.parameter %block[24] : !llvm.ptr -> !warp.array<1 x f32>
      // loop over [begin, end): body
    ```
  }];
  let dependentDialects = [
    "::mlir::arith::ArithDialect", "::mlir::LLVM::LLVMDialect",
    "::warp::WarpDialect"];
}

def RotateLoops : WarpPass<"warp-rotate-loops"> {
  let summary = "Let the threads of a GPU warp take iterations in turn";
  let description = [{
    In a loop whose iterations may run in any order, where all threads update
    the same element in the same iteration, the 32 lanes of a warp begin a tile
    of 32 iterations at different ones. The sum of an iteration travels from
    lane to lane and is added to the array once. A warp with a lane missing, and
    what is left after the last full tile, go through the loop as it was.

    ```mlir
    scf.for %j = %c0 to %n step %c1 {
      // %v
      %old = warp.atomic_components add(%v), %y[%j] : ...
    }
    // ==>
    scf.for %tile = %c0 to %end step %c32 {
      %total = scf.for %step = %c0 to %c32 step %c1 iter_args(%sum = %zero) {
        // %j = %tile + (%lane + %step) mod 32, %v
        %next = arith.addf %sum, %v fastmath<reassoc> : f32
        %moved = llvm.call_intrinsic "llvm.nvvm.shfl.sync.idx.i32"(...) // %next
        scf.yield %moved : f32
      }
      // %mine = %tile + %lane
      %old = warp.atomic_components add(%total), %y[%mine] : ...
    }
    scf.for %j = %end to %n step %c1 {
      // as before
    ```
  }];
  let dependentDialects = [
    "::mlir::arith::ArithDialect", "::mlir::scf::SCFDialect",
    "::mlir::LLVM::LLVMDialect"];
}

def PrivatizeAtomics : WarpPass<"warp-privatize-atomics"> {
  let summary = "Combine updates of one element over a range of threads";
  let description = [{
    An atomic whose address all threads share and whose old value nobody uses
    is accumulated privately and published once: per range of threads on the
    CPU, per block on a GPU. On a GPU, one whose address the threads of a warp
    share, in one iteration of a loop or one row of the launch, is combined over
    the warp.

    Where atomics remain on the CPU, and so few threads would share the launch
    that one thread without atomic instructions is faster, the entry gets an
    exclusive recipe: it runs on one thread and updates elements plainly. In a
    deterministic launch so is every entry with atomics whose order would show,
    sums that are exact aside; on a GPU that is a launch of one block, with one
    thread if its updates cannot be combined.

    ```mlir
    // loop over threads:
    %old = warp.atomic_components add %x, %sum[%c0] : ...
    // ==>
    // loop over threads:
    %s1 = arith.addf %s0, %x fastmath<reassoc> : f32
    // after the loop:
    %old = warp.atomic_components add %s, %sum[%c0] : ...
    ```
  }];
  let dependentDialects = [
    "::mlir::arith::ArithDialect", "::mlir::scf::SCFDialect",
    "::mlir::LLVM::LLVMDialect"];
}

def DeferUpdates : WarpPass<"warp-defer-updates"> {
  let summary = "Compute in lanes, then update elements in order";
  let description = [{
    The loop over threads of a CPU entry that runs alone becomes two, for
    stretches of a few hundred threads: the first leaves what is added to
    elements, and their indices, in buffers, and can be vectorised; the second
    performs the updates one by one. Done where a body without control flow
    computes much for each update.

    ```mlir
    // loop over threads:
    %old = warp.atomic_components add(%v), %f[%i] : ...
    // ==>
    // loop over threads of a stretch:
    llvm.store %v, %values[%slot]
    llvm.store %i, %places[%slot]
    // loop over the same threads:
    %old = warp.atomic_components add(%known), %f[%place] : ...
    ```
  }];
  let dependentDialects = [
    "::mlir::arith::ArithDialect", "::mlir::LLVM::LLVMDialect"];
}

def LowerSums : WarpPass<"warp-lower-sums"> {
  let summary = "Add to exact sums by integers";
  let description = [{
    A float is a whole multiple of the least subnormal one. Its digits are
    added to those of the sum, which the runtime keeps beside the array and
    rounds after the launch.

    ```mlir
    %old = warp.atomic_components add (%x), %sum[%j] {warp.sum = 192} : ...
    // ==>
    %p = warp.address %sum[%j] : !warp.array<1 x f32>, i32
    // %number: of the element, by %p
    llvm.call @warp_add_exactly_f32(%digits, %touched, %count, %number, %x)
    ```
  }];
  let dependentDialects = [
    "::mlir::arith::ArithDialect", "::mlir::scf::SCFDialect",
    "::mlir::LLVM::LLVMDialect", "::warp::WarpDialect"];
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

def LowerMath : WarpPass<"warp-lower-math"> {
  let summary = "Call the target's math library";
  let description = [{
    Operations that a processor has stay as they are; the others become calls:
    of libdevice on the GPU, of the C library or of our device library on the
    CPU.

    ```mlir
    %y = math.sin %x : f32
    // ==> target=sm_90
    %y = llvm.call @__nv_sinf(%x) : (f32) -> f32
    ```
  }];
  let dependentDialects = [
    "::mlir::arith::ArithDialect", "::mlir::LLVM::LLVMDialect"];
}

def ConvertToLLVM : WarpPass<"warp-convert-to-llvm"> {
  let summary = "Convert what is left to the LLVM dialect";
  let dependentDialects = ["::mlir::LLVM::LLVMDialect",
                           "::mlir::cf::ControlFlowDialect"];
}

def VerifyLLVM : WarpPass<"warp-verify-llvm"> {
  let summary = "Check that only the LLVM dialect is left";
}

#endif // WARP_PASSES_TD

//===- Launch.td - Launch contract: one record per fact -------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A launch fact crosses the border between the compiler and the runtime.
// A variant fact says which launches code is compiled for, a schedule fact how
// such launches are made. warp-tblgen writes from each record the members of
// `CompileOptions`, the key of a variant and `Schedule` (warp/Schedule.h), the
// conversions from and to `#warp.variant` and `#warp.schedule`, their accessors
// and verifiers, the text and binary forms, what Python shows, and the tables of
// docs/launch.md. To add a fact is to add a record, and to read it where it
// counts.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LAUNCH_TD
#define WARP_LAUNCH_TD

include "LaunchFact.td"

//===----------------------------------------------------------------------===//
// Launches that code is compiled for
//===----------------------------------------------------------------------===//

def Launch_Rank : VariantFact<"rank", LaunchNumber<1, 1, 4>,
    "dimensions of the launch", Key>;
def Launch_Packed : VariantFact<"packed", LaunchMask<>,
    "bit i: argument i is an array packed in row-major order, on a GPU one that "
    "begins at a multiple of its elements' size or of 16 bytes", Key>;
def Launch_NonNegative : VariantFact<"non_negative", LaunchMask<>,
    "bit i: argument i is an integer that is not negative, so that indices made "
    "of it need not be wrapped", Key>;

def Launch_Zeros : VariantFact<"zeros", LaunchMask<>,
    "bit i: argument i, or on a CPU the first element of such an array, is a zero "
    "that leaves out code", Key> {
  let phrase = "zeros that leave out code";
}

def Launch_Large : VariantFact<"large", LaunchFlag<>,
    "GPU: the launch fills the device many times over", KeyIfUsed> {
  let phrase = "many threads";
}
def Launch_Underfilled : VariantFact<"underfilled", LaunchFlag<>,
    "fewer threads than fill the GPU, or on a CPU fewer than 16: scalar code, "
    "compiled with less effort, where no loop may be long", KeyIfUsed> {
  let phrase = "few threads";
}
def Launch_Skinny : VariantFact<"skinny", LaunchFlag<>,
    "GPU: 32 x 32 tiles of the last two dimensions would be mostly empty",
    KeyIfUsed>;
def Launch_InnerExtent : VariantFact<"inner_extent", LaunchPower<0, 0, 64>,
    "CPU: upper bound of the extent of the last dimension, a power of two, 0 "
    "leaves it open", KeyIfUsed> {
  let phrase = "rows of at most {0}";
}
def Launch_MaxBlockCoarsening : VariantFact<"max_block_coarsening",
    LaunchPower<1, 1, 4>,
    "GPU: so many neighbouring blocks may be merged without leaving "
    "multiprocessors idle", KeyIfUsed>;
def Launch_ThreadOrder : VariantFact<"thread_order", LaunchFlag<>,
    "CPU, not deterministic: atomic updates whose result is used are made in the "
    "order of the threads", KeyIfUsed>;
def Launch_FarRows : VariantFact<"far_rows", LaunchFlag<>,
    "CPU: rows of an array begin a multiple of 2 KiB apart, so that elements of "
    "many rows fall into one set of the cache", KeyIfUsed> {
  let phrase = "rows 2 KiB apart";
}

def Launch_Index32 : VariantFact<"index32", LaunchFlag<"true">,
    "no array and no launch has 2^31 elements or more", Key> {
  let phrase = "64-bit indices";
  let phraseIf = "!$_self";
}
def Launch_Flat : VariantFact<"flat", LaunchFlag<>,
    "GPU: one linear grid axis for all dimensions", Key> {
  let phrase = "one axis";
}
def Launch_Disjoint : VariantFact<"disjoint", LaunchFlag<>,
    "no memory that the launch writes overlaps another of its arrays or their "
    "gradients", Key> {
  let phrase = "arrays may overlap";
  let phraseIf = "!$_self";
}
def Launch_Ordered : VariantFact<"ordered", LaunchFlag<>,
    "deterministic: sums are made in one order, because that is faster or the "
    "arrays overlap; otherwise they are exact", Key>;
def Launch_BlockDim : VariantFact<"block_dim", LaunchNumber<256, 1, 1048576>,
    "threads of a GPU block", Key>;

def Launch_Target : VariantFact<"target", LaunchText<"cpu">,
    "`cpu`, or the GPU architecture, `sm_90`; `cpu:NAME` is a processor other "
    "than the host, for text only", PerKernel>;
def Launch_Debug : VariantFact<"debug", LaunchFlag<>,
    "bounds checks that report through the error record", PerKernel>;
def Launch_FastMath : VariantFact<"fast_math", LaunchFlag<>,
    "floating-point arithmetic may be reassociated and approximated", PerKernel>;
def Launch_Deterministic : VariantFact<"deterministic", LaunchFlag<>,
    "sums have the same bits in every run", PerKernel>;
def Launch_Threads : VariantFact<"threads", LaunchNumber<16, 1, 1048576>,
    "CPU: threads that would share the launch; above 16 makes no difference",
    PerKernel>;
def Launch_MinBlocks : VariantFact<"min_blocks", LaunchNumber<0, 0, 65536>,
    "GPU: fewest blocks that a multiprocessor shall hold, 0 leaves it open",
    PerKernel>;
def Launch_Lanes : VariantFact<"lanes", LaunchPower<0, 0, 64>,
    "CPU: threads that are lanes of a vector together, 0 leaves it open, 1 keeps "
    "threads scalar", PerKernel>;

// Not of interest to passes.
let inAttribute = 0 in {
def Launch_LineInfo : VariantFact<"lineinfo", LaunchFlag<>,
    "source lines in the code", PerKernel>;
def Launch_OptLevel : VariantFact<"opt_level", LaunchNumber<2, 0, 3>,
    "effort of the compiler", PerKernel>;
def Launch_DriverVersion : VariantFact<"driver_version",
    LaunchNumber<0, 0, 1000000>,
    "GPU: driver that turns the PTX into machine code, which is what is kept "
    "then; 0 keeps the PTX", PerKernel>;
def Launch_MaxRegisters : VariantFact<"max_registers", LaunchNumber<0, 0, 65536>,
    "registers that a GPU thread may use, 0 leaves it to the driver", PerKernel>;
def Launch_Linked : VariantFact<"linked", LaunchFlag<>,
    "GPU: long functions of the device library stay calls, whose machine code is "
    "linked when the kernel is loaded (FirstCode.h)", PerKernel>;
}

//===----------------------------------------------------------------------===//
// How they are made
//===----------------------------------------------------------------------===//

def Launch_Coarsening : ScheduleFact<"coarsening", LaunchNumber<1, 1, 1048576>,
    "GPU: launch indices per thread">;
def Launch_RowCoarsening : ScheduleFact<"row_coarsening",
    LaunchNumber<1, 1, 1048576>,
    "GPU: those of `coarsening` that follow each other in the dimension before "
    "the last; the others do in the first">;
def Launch_BlockCoarsening : ScheduleFact<"block_coarsening",
    LaunchNumber<1, 1, 1024>,
    "GPU: neighbouring blocks, in the dimension before the last, that are "
    "merged">;
def Launch_TransposeTile : ScheduleFact<"transpose_tile",
    LaunchNumber<0, 0, 1024>,
    "GPU: side of the square tile, in the last two dimensions, that a block "
    "stages in shared memory, 0 without; blocks are numbered along one axis">;
def Launch_SplitReduction : ScheduleFact<"split_reduction",
    LaunchNumber<1, 1, 1024>,
    "GPU: threads of a block that share one launch index">;
def Launch_ReverseOrder : ScheduleFact<"reverse_order", LaunchFlag<>,
    "GPU: every other launch may run its blocks last to first, and then finds in "
    "the cache what the launch before left there">;
def Launch_SingleBlock : ScheduleFact<"single_block", LaunchNumber<0, 0, 1024>,
    "GPU: threads of the only block of a launch, 0 if it has several">;
def Launch_SizeFacts : ScheduleFact<"size_facts", SizeFactMask<>,
    "facts of a launch's size that the code depends on, a mask of `SizeFact`; "
    "launches that differ in others only may run it, too">;
def Launch_Exclusive : ScheduleFact<"exclusive", LaunchFlag<>,
    "CPU: the code updates elements without atomic instructions, so one thread "
    "runs a launch, or several with copies of the arrays in `copied`">;
def Launch_Copied : ScheduleFact<"copied",
    LaunchValue<"CopiedArrays", "::warp::CopiedAttr">,
    "CPU: arrays that exclusive code may add to in private copies">;
def Launch_Sums : ScheduleFact<"sums",
    LaunchValue<"std::vector<SummedArray>", "::mlir::ArrayAttr">,
    "arrays with exact sums, for each of which the parameter block has a "
    "`SumDescriptor` after the arguments, then the others; none without exact "
    "sums">;
def Launch_Switches : ScheduleFact<"switches", LaunchMask<>,
    "bit i: a good part of the code would be left out if argument i, or the first "
    "element of such an array, were zero">;
def Launch_Cost : ScheduleFact<"cost", LaunchAmount<>,
    "rough operations of one thread, where loops count 32 times their body">;
def Launch_Width : ScheduleFact<"lanes", LaunchNumber<1, 1, 64>,
    "CPU: threads that are lanes of a vector, from warp-widen-threads on">;

def Launch_TensorMaps : CodeFact<"tensor_maps",
    LaunchValue<"std::vector<TensorMap>">,
    "GPU: tensor maps of arrays, for TMA, that the parameter block has behind "
    "everything else">;
def Launch_FixedBlock : CodeFact<"fixed_block", LaunchFlag<>,
    "GPU: threads of a block wait for each other, or count on their number, so "
    "blocks have the size that the code is for">;
def Launch_Cooperative : CodeFact<"cooperative", LaunchFlag<>,
    "GPU: the threads of a block work on tiles together; blocks are numbered "
    "along one axis, and each is a row of the launch's last dimension">;
def Launch_Ragged : CodeFact<"ragged", LaunchFlag<>,
    "GPU: such blocks are threads that follow each other in the launch, of any "
    "extents">;
def Launch_DynamicBytes : CodeFact<"dynamic_bytes", LaunchNumber<0, 0, 16777216>,
    "GPU: bytes of dynamic shared memory per block">;
def Launch_Atomics : CodeFact<"atomics", LaunchFlag<>,
    "CPU: the code has atomic instructions, so no exclusive code may run beside "
    "it">;
def Launch_UsesPrintf : CodeFact<"uses_printf", LaunchFlag<>,
    "the code prints">;
def Launch_IsLong : CodeFact<"is_long", LaunchFlag<>,
    "CPU: so many instructions that compiling them well takes long">;
def Launch_IsExact : CodeFact<"is_exact", LaunchFlag<>,
    "CPU: floating-point numbers have the same bits at every `opt_level`, but "
    "for the sign and payload of NaNs">;

#endif // WARP_LAUNCH_TD

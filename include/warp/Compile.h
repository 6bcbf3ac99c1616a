//===- Compile.h - From a module to code that runs --------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The compiler as the runtime sees it. `compile` takes a verified module of
// the warp dialect and the facts of one launch variant, and returns an object
// file (CPU) or PTX text (GPU) with what is needed to run it. Nothing here is
// remembered between calls; `fingerprint` names the result, so that a cache
// can.
//
// A compiled kernel has one argument, the parameter block described in
// "warp/Launch.h". `parameters` tells where each kernel argument lies in it.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_COMPILE_H
#define WARP_COMPILE_H

#include "warp/Builder.h"
#include "warp/Error.h"
#include "warp/ExactSums.h"
#include "warp/Export.h"
#include "warp/PrivateCopies.h"
#include "warp/SizeFacts.h"
#include "warp/TensorMaps.h"

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace warp {

/// One variant of a kernel.
struct CompileOptions {
  /// "cpu", or the GPU architecture, "sm_90". "cpu:NAME" is a processor other
  /// than the host, for text only.
  std::string target = "cpu";
  /// Dimensions of the launch, 1 to 4.
  int rank = 1;
  /// Bit i: the i-th argument is an array packed in row-major order, or an
  /// integer that is not negative (indices made of it need not be wrapped).
  uint64_t contiguous = 0;
  /// No array and no launch has 2^31 elements or more.
  bool index32 = true;
  /// GPU: a linear thread index instead of one grid axis per dimension.
  bool flat = false;
  /// GPU: the launch fills the card many times over, so a thread may take
  /// several items.
  bool large = false;
  /// No memory that the launch writes overlaps another of its arrays or their
  /// gradients.
  bool disjoint = false;
  /// Bounds checks that report through the error record.
  bool debug = false;
  bool fastMath = false;
  /// Sums have the same bits in every run.
  bool deterministic = false;
  /// Deterministic: sums are made in one order, because that is quicker or the
  /// arrays of the launch overlap. Otherwise they are exact.
  bool ordered = false;
  /// CPU, not deterministic: atomic updates whose result is used are made in
  /// the order of the threads.
  bool threadOrder = false;
  bool lineinfo = false;
  int optLevel = 2;
  /// Threads of a GPU block.
  int blockDim = 256;
  /// CPU: threads that would share the launch; above 16 makes no difference.
  int threads = 16;
  /// GPU: the driver that turns the PTX into machine code, which is what is
  /// kept then; 0 keeps the PTX.
  int driverVersion = 0;
  /// Registers a GPU thread may use; 0 leaves it to the driver.
  int maxRegisters = 0;
  /// GPU: fewest blocks that a multiprocessor shall hold; 0 leaves it open.
  int minBlocks = 0;
  /// CPU: threads that are lanes of a vector together, a power of two; 0 leaves
  /// it to the compiler, 1 keeps threads scalar.
  int lanes = 0;
  /// CPU: upper bound of the extent of the last dimension, a power of two; 0
  /// leaves it open.
  int innerExtent = 0;
  /// The launch has fewer threads than fill the GPU, or a vector of a CPU.
  bool underfilled = false;
  /// GPU: 32 x 32 tiles of the last two dimensions would be mostly empty.
  bool skinny = false;
  /// GPU: so many neighbouring blocks may be merged without leaving
  /// multiprocessors idle: 1, 2 or 4.
  int maxBlockCoarsening = 1;
  /// GPU: long functions of the device library stay calls. Their machine code
  /// is linked when the kernel is loaded (FirstCode.h).
  bool linked = false;
};

/// A place in the user's source that an error record can name. `array` is the
/// array of an access out of bounds (record kind 0), or the message of a failed
/// assertion (kind 1).
struct Site {
  std::string kernel, file, array;
  int line = 0, column = 0;
};

struct Code {
  /// Symbol of the entry.
  std::string entry;
  /// ELF object or PTX text.
  std::vector<char> binary;
  std::vector<Site> sites;
  /// Rough operations of one thread; loops count 32 times their body.
  double cost = 0;
  bool usesPrintf = false;
  /// GPU: launch indices per thread.
  int coarsening = 1;
  /// GPU: threads of the only block of a launch; 0 if it has several.
  int singleBlock = 0;
  /// CPU: the code updates elements without atomic instructions, because so
  /// few threads would lose more by those than they gain. It must have the
  /// arrays to itself and run on one thread, or have copies of those in
  /// `copied` for each.
  bool exclusive = false;
  /// CPU: what exclusive code may add to in private copies.
  CopiedArrays copied;
  /// CPU: the code has atomic instructions, so no exclusive code may run.
  bool atomics = false;
  /// CPU: so many instructions that compiling them well takes long.
  bool isLong = false;
  /// CPU: floating-point numbers have the same bits at every `optLevel`, but
  /// for the sign and payload of NaNs.
  bool isExact = false;
  /// Arrays with exact sums, for each of which the parameter block has a
  /// `SumDescriptor` after the arguments; then the others. Empty if there are
  /// no exact sums.
  std::vector<SummedArray> sums;
  /// Milliseconds by compile phase; empty when it comes from a cache.
  std::map<std::string, double> phaseMs;
  /// GPU: threads of a block wait for each other, or count on their number, so
  /// a launch has blocks of the size that the code is for.
  bool fixedBlock = false;
  /// GPU: the threads of a block work on tiles together. Blocks are numbered
  /// along one axis, and each is a row of the launch's last dimension.
  bool cooperative = false;
  /// GPU: such blocks are threads that follow each other in the launch, of any
  /// extents.
  bool ragged = false;
  /// GPU: bytes of block memory that a launch asks for, because blocks have
  /// less without being asked.
  int dynamicBytes = 0;
  /// GPU: tensor maps, for TMA, that the parameter block has behind everything
  /// else.
  std::vector<TensorMap> tensorMaps;
  /// GPU: those of `coarsening` that follow each other in the dimension before
  /// the last; the others do in the first.
  int rowCoarsening = 1;
  /// GPU: side of the square tile, in the last two dimensions, that a block
  /// stages in shared memory; 0 without. Blocks are numbered along one axis.
  int transposeTile = 0;
  /// GPU: threads of a block that share one launch index.
  int splitReduction = 1;
  /// GPU: what of the size of a launch the code depends on, a mask of
  /// `SizeFact`. A launch that differs in another way may run it, too.
  int sizeFacts = 0;
  /// GPU: neighbouring blocks, in the dimension before the last, that are
  /// merged.
  int blockCoarsening = 1;
  /// GPU: every other launch may run its blocks last to first, so that it finds
  /// in the cache what the launch before left there.
  bool reverseOrder = false;
};

/// Compiles one variant. Throws `Error` of kind `Compile`.
WARP_API Code compile(const Module &module, const CompileOptions &options);

/// A decision of the compiler about launches: what it is about, how it was
/// settled and why, and the source line, 0 for the kernel as a whole.
struct Choice {
  std::string what, value, reason;
  int line = 0;
};

/// The decisions about one variant. Compiles it to find out.
WARP_API std::vector<Choice> schedule(const Module &module,
                                      const CompileOptions &options);

/// IR or code of a stage as text: warp, thread, llvm, ptx or asm.
WARP_API std::string emitText(const Module &module,
                              const CompileOptions &options,
                              const std::string &stage);

/// 64 hexadecimal digits that name the result of `compile`: a hash of the
/// canonical IR, the options, the host CPU and the compiler's build.
WARP_API std::string fingerprint(const Module &module,
                                 const CompileOptions &options);

/// One argument of a kernel.
struct Param {
  enum class Kind { Scalar, Composite, Array, Struct };

  std::string name;
  Kind kind = Kind::Scalar;
  /// Text of the type: "f32", "!warp.vec<3 x f32>", "!warp.array<...>".
  std::string type;
  /// Place in the parameter block; the first argument starts at
  /// `firstArgument`.
  int64_t offset = 0;
  int64_t size = 0;
  /// Arrays: number of dimensions, text and byte size of the element type.
  int rank = 0;
  std::string element;
  int64_t elementSize = 0;
  /// Byte offsets, from `offset`, of the array descriptors in the argument:
  /// {0} for an array, one per array field for a struct.
  std::vector<int64_t> arrays;
};

WARP_API std::vector<Param> parameters(const Module &module);

/// What a kernel may do with an array, and where the launch describes it.
struct Access {
  /// By loads, by stores, by atomics.
  bool loaded = false, stored = false, combined = false;
  /// Whether something depends on what an atomic returned.
  bool fetched = false;
  /// Whether it is loaded as a tile, or in a loop that may end by what is
  /// loaded: code for the CPU depends on whether another array overlaps it.
  bool watched = false;
  /// Source line of the first store or atomic, 0 if there is none.
  unsigned line = 0;
  /// Byte offset of the descriptor in the parameter block.
  int64_t offset = 0;
  /// Bytes of an element; of one of the gradient, 0 if the kernel has no use
  /// for gradients.
  int64_t elementSize = 0, gradientSize = 0;
};

/// One for each array among the kernel's arguments: in order, those in structs
/// in the order of the fields.
WARP_API std::vector<Access> accesses(const Module &module);

/// Dimensions of the thread index that the kernel reads, 1 if it reads none.
WARP_API int threadRank(const Module &module);

/// Hexadecimal digits that differ between kernels that differ, whatever they
/// are compiled for.
WARP_API std::string sourceHash(const Module &module);

/// The host's processor: its name, a space and its features, "+avx2,-xop".
WARP_API std::string hostProcessor();

/// GPU architectures there is code for, as 10 * major + minor.
WARP_API std::vector<int> gpuArchitectures();

/// Loads CPU objects into the process.
class WARP_API Jit {
public:
  static Jit &get();
  /// Address of the entry.
  void *load(const Code &code);
  /// Frees what `load` returned `entry` for. Nothing of it may be running.
  void unload(void *entry);

private:
  Jit();
  struct Impl;
  Impl *impl;
};

} // namespace warp

#endif // WARP_COMPILE_H

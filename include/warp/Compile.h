//===- Compile.h - Compilation of modules to machine code -------*- C++ -*-===//
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
#include "warp/Export.h"
#include "warp/Schedule.h"

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

namespace warp {

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
  Schedule schedule;
  /// Milliseconds by compile phase; empty when it comes from a cache.
  std::map<std::string, double> phaseMs;
};

/// Compiles one variant. Throws `Error` of kind `Compile`.
WARP_API Code compile(const Module &module, const CompileOptions &options);

/// A decision of the compiler about launches: what it is about, how it was
/// settled and why, and the source line, 0 for the kernel as a whole.
struct Choice {
  std::string what, value, reason;
  int line = 0;
};

/// The decisions about one variant.
struct Decisions {
  std::vector<Choice> choices;
  Schedule schedule;
};

/// Compiles the variant to find out.
WARP_API Decisions schedule(const Module &module,
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

/// Accesses of a kernel to an array, and where the launch describes it.
struct Access {
  /// By loads, by stores, by atomics.
  bool loaded = false, stored = false, combined = false;
  /// True if something depends on what an atomic returned.
  bool fetched = false;
  /// True if it is loaded as a tile, loaded or stored in a loop that goes along
  /// it, or loaded in one that may end by it: code for the CPU depends on
  /// whether another array overlaps it.
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

/// A 64-bit integer that a kernel is given: in its parameter block, or in each
/// element of an array.
struct IdWord {
  /// The array's number among the accesses; -1 for the parameter block.
  int32_t access = -1;
  /// Its byte in the block, or in an element.
  int64_t offset = 0;

  bool operator==(const IdWord &other) const {
    return std::tie(access, offset) == std::tie(other.access, other.offset);
  }
  bool operator<(const IdWord &other) const {
    return std::tie(access, offset) < std::tie(other.access, other.offset);
  }
};

/// A word that may become the id of geometry: the kernel uses it as one, or
/// stores it, and if the stored word is an id, so is this one.
struct IdFlow {
  IdWord from;
  std::optional<IdWord> to;

  bool operator==(const IdFlow &other) const {
    return std::tie(from, to) == std::tie(other.from, other.to);
  }
  bool operator<(const IdFlow &other) const {
    return std::tie(from, to) < std::tie(other.from, other.to);
  }
};

WARP_API std::vector<IdFlow> idFlows(const Module &module);

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

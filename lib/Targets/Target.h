//===- Target.h - Target interface: features, lowering, codegen -*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A target answers questions and emits its own instructions, so that passes
// name no architecture: they ask for a feature, a limit or the subgroup size,
// and build what differs by the functions here. Each family of targets has a
// folder with three files of equal names:
//
//   Info.cpp      names, features and limits, as a table
//   Lowering.cpp  operations: subgroups, atomics, roots, printf, the entry, and
//                 the conversion of MLIR's `gpu` dialect
//   Codegen.cpp   the LLVM module: machine, device library, text edits
//
// See docs/targets.md.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TARGETS_TARGET_H
#define WARP_LIB_TARGETS_TARGET_H

#include "llvm/ADT/STLFunctionalExtras.h"
#include "llvm/ADT/SmallVector.h"
#include "llvm/ADT/StringRef.h"

#include <cstdint>
#include <initializer_list>
#include <memory>
#include <string>

namespace llvm {
class Function;
class Module;
class TargetMachine;
} // namespace llvm

namespace mlir {
class DialectRegistry;
class LLVMTypeConverter;
class Location;
class ModuleOp;
class OpBuilder;
class Operation;
class RewritePatternSet;
class Value;
namespace LLVM {
class LLVMFuncOp;
} // namespace LLVM
} // namespace mlir

namespace warp {

struct CompileOptions;

/// Abilities of targets that passes use.
enum class Feature {
  /// One instruction adds two neighbouring f32 to memory.
  PairedFloatAtomics,
  /// An instruction approximates 1/sqrt(x) of f32.
  ReciprocalRoot,
  /// An instruction finds the largest integer of the lanes that are here.
  SubgroupMax,
  /// The device library has functions by which the threads of a block work on
  /// tiles: products in registers, factors, transforms, reductions.
  BlockTiles,
  /// Copies to shared memory that run while threads compute.
  AsyncCopy,
  /// Matrix instructions of a subgroup for f16 and bf16.
  Mma,
  /// The same for f64.
  DoubleMma,
  /// Matrix instructions of four subgroups that read shared memory.
  Wgmma,
  /// Hardware that loads tiles by tensor maps (TMA).
  TensorMaps,
  /// A launch may start before the one in front of it has ended.
  ProgrammaticLaunch,
};

class FeatureSet {
public:
  constexpr FeatureSet() = default;
  constexpr FeatureSet(std::initializer_list<Feature> features) {
    for (Feature feature : features)
      bits |= 1u << unsigned(feature);
  }
  constexpr bool has(Feature feature) const {
    return bits >> unsigned(feature) & 1;
  }
  constexpr FeatureSet operator|(FeatureSet other) const {
    FeatureSet both;
    both.bits = bits | other.bits;
    return both;
  }

private:
  uint32_t bits = 0;
};

/// A row of a target's table.
struct TargetFacts {
  FeatureSet features;
  /// Lanes that run in lockstep.
  int64_t subgroupSize = 1;
  /// Bytes of shared memory that a block can have, and that it has without
  /// asking the driver.
  int64_t sharedBytes = 0, staticSharedBytes = 48 << 10;
  /// Threads of a block.
  int64_t maxThreads = 1024;
};

/// A processor, or family of them, that code is for. There is one object for a
/// name; it is never deleted.
class TargetInfo {
public:
  virtual ~TargetInfo() = default;

  llvm::StringRef getName() const { return name; }
  bool has(Feature feature) const { return facts.features.has(feature); }
  int64_t getSubgroupSize() const { return facts.subgroupSize; }
  /// True if that many threads are whole subgroups.
  bool hasFullSubgroups(int64_t threads) const {
    return threads % facts.subgroupSize == 0;
  }
  int64_t getSharedBytes() const { return facts.sharedBytes; }
  int64_t getStaticSharedBytes() const { return facts.staticSharedBytes; }
  int64_t getMaxThreads() const { return facts.maxThreads; }

  /// True if threads come in blocks that share memory and run in lockstep
  /// subgroups (GPUs). A launch on other targets is a range of indices, of
  /// which vectors take several.
  virtual bool isSimt() const { return true; }

  /// Bits of the widest vectors that do not lower the clock; 0 on SIMT targets.
  virtual int64_t getVectorBits() const { return 0; }

  /// True if C's convention returns the third float of a struct on the stack of
  /// the x87.
  virtual bool returnsOnX87() const { return false; }

  //===--------------------------------------------------------------------===//
  // Lowering
  //===--------------------------------------------------------------------===//

  /// Gives the entry its calling convention; its argument is a block of
  /// parameters of so many bytes.
  virtual void declareEntry(mlir::LLVM::LLVMFuncOp entry, int64_t bytes,
                            int64_t alignment) const = 0;

  /// True if all lanes of the subgroup get here together.
  virtual mlir::Value emitIsFull(mlir::OpBuilder &b, mlir::Location loc) const;
  /// True if a condition holds in all lanes of a full subgroup.
  virtual mlir::Value emitVoteAll(mlir::OpBuilder &b, mlir::Location loc,
                                  mlir::Value condition) const;
  /// In which lanes of a full subgroup a condition holds: an integer with a bit
  /// for each.
  virtual mlir::Value emitBallot(mlir::OpBuilder &b, mlir::Location loc,
                                 mlir::Value condition) const;
  /// The largest unsigned i32 of the lanes that are here (SubgroupMax).
  virtual mlir::Value emitActiveMax(mlir::OpBuilder &b, mlir::Location loc,
                                    mlir::Value value) const;
  /// A bit for each lane that is here.
  virtual mlir::Value emitActiveLanes(mlir::OpBuilder &b,
                                      mlir::Location loc) const;
  /// True if a value of 64 bits is the same in all of `lanes`, which are here.
  virtual mlir::Value emitAgree(mlir::OpBuilder &b, mlir::Location loc,
                                mlir::Value value, mlir::Value lanes) const;
  /// Waits for `lanes`, or, without, for those of a full subgroup, and their
  /// accesses to memory.
  virtual void emitSubgroupBarrier(mlir::OpBuilder &b, mlir::Location loc,
                                   mlir::Value lanes) const;
  /// True if a condition holds in any thread of the block; waits for all.
  virtual mlir::Value emitBlockAny(mlir::OpBuilder &b, mlir::Location loc,
                                   mlir::Value condition) const;
  /// The target's approximation of 1/sqrt(x) of f32 (ReciprocalRoot).
  /// `flushes`: subnormal numbers count as zeros.
  virtual mlir::Value emitRsqrt(mlir::OpBuilder &b, mlir::Location loc,
                                mlir::Value x, bool flushes) const;
  /// Adds two f32 to memory, of which the address is a multiple of eight
  /// (PairedFloatAtomics).
  virtual void emitPairedAtomic(mlir::OpBuilder &b, mlir::Location loc,
                                mlir::Value pointer, mlir::Value x,
                                mlir::Value y) const;
  /// Prints arguments that are packed in a buffer of so many bytes.
  virtual void emitPrintf(mlir::OpBuilder &b, mlir::Location loc,
                          mlir::ModuleOp module, mlir::Value format,
                          mlir::Value buffer, int64_t bytes) const;
  /// Synchronisation scope, in LLVM's terms, of atomics on memory that all
  /// threads of a launch see, and on that of a block.
  virtual llvm::StringRef getLaunchScope() const { return ""; }
  virtual llvm::StringRef getBlockScope() const { return ""; }

  /// The address space of a constant table of so many bytes. `uniform`: the
  /// lanes of a subgroup read the same element.
  virtual unsigned getTableSpace(bool uniform, int64_t bytes) const {
    return 0;
  }

  /// The function for `name` ("sin") of f32 or f64; empty if LLVM expands the
  /// operation itself.
  virtual std::string getMathFunction(llvm::StringRef name, bool isSingle,
                                      bool fast) const = 0;
  /// A function of one f32 that gives sine and cosine; empty without.
  virtual llvm::StringRef getSineCosine() const { return ""; }

  /// Patterns for operations of the `gpu` dialect.
  virtual void addPatterns(mlir::LLVMTypeConverter &types,
                           mlir::RewritePatternSet &patterns) const {}
  /// Before the conversion: rewrites operations of a `gpu.module`.
  virtual void prepareKernel(mlir::Operation *module) const {}
  /// After it, when the module holds the kernel itself.
  virtual void finishKernel(mlir::LLVM::LLVMFuncOp kernel,
                            int64_t blockDim) const;
  /// True for operations, after the conversion, by which the threads of a block
  /// wait for each other.
  virtual bool isBlockBarrier(mlir::Operation *op) const { return false; }

  //===--------------------------------------------------------------------===//
  // Code generation
  //===--------------------------------------------------------------------===//

  /// Name and features of the processor, where the target's name leaves it
  /// open.
  virtual std::string describeProcessor() const { return ""; }
  /// Throws if this library has no code generator for it.
  virtual std::unique_ptr<llvm::TargetMachine>
  createMachine(const CompileOptions &options) const = 0;
  /// Sets triple, layout and function attributes, and links the libraries.
  virtual void prepareModule(llvm::Module &module, llvm::TargetMachine &machine,
                             const CompileOptions &options) const = 0;
  /// Blocks that a multiprocessor is to hold, or registers of a thread; 0
  /// leaves it open.
  virtual void limitRegisters(llvm::Function &kernel, int leastBlocks,
                              int mostRegisters) const {}
  /// Last changes to the module, and to the text of it.
  virtual void finishModule(llvm::Module &module) const {}
  virtual void finishText(llvm::SmallVectorImpl<char> &text,
                          llvm::StringRef entry) const {}
  /// Ending of files with assembly: "s", "ptx".
  virtual llvm::StringRef getTextSuffix() const { return "s"; }

protected:
  TargetInfo(llvm::StringRef name, TargetFacts facts)
      : name(name), facts(facts) {}

private:
  std::string name;
  TargetFacts facts;
};

/// The target of a name: "cpu", "cpu:skylake-avx512", "sm_90", "gfx90a"; null
/// if there is none.
const TargetInfo *parseTarget(llvm::StringRef name);

/// An error about a name that is none.
std::string describeUnknownTarget(llvm::StringRef name);

/// That of options; throws if there is none.
const TargetInfo &getTarget(const CompileOptions &options);

/// Dialects that lowering for any target needs, and their translations to LLVM
/// IR.
void registerTargetDialects(mlir::DialectRegistry &registry);
void registerTargetTranslations(mlir::DialectRegistry &registry);

} // namespace warp

#endif // WARP_LIB_TARGETS_TARGET_H

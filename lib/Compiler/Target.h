//===- Target.h - Lowering of LLVM IR to machine code -----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The part of the compiler below the LLVM dialect: a machine is made, an LLVM
// module prepared (libraries linked, attributes set), optimised and emitted.
// Targets do these steps in their own way (lib/Targets).
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_COMPILER_TARGET_H
#define WARP_LIB_COMPILER_TARGET_H

#include "Targets/Target.h"
#include "warp/Compile.h"

#include "llvm/ADT/SmallVector.h"
#include "llvm/ADT/StringRef.h"

#include <memory>
#include <string>

namespace llvm {
class Function;
class Module;
class PassInstrumentationCallbacks;
class TargetMachine;
} // namespace llvm

namespace warp {

/// Machines are costly to make and not safe to share; a lease gives one back
/// to the pool of its configuration.
class MachineLease {
public:
  MachineLease(const std::string &key,
               std::unique_ptr<llvm::TargetMachine> machine);
  ~MachineLease();
  MachineLease(MachineLease &&);
  llvm::TargetMachine &operator*() const { return *machine; }
  llvm::TargetMachine *operator->() const { return machine.get(); }

  /// Takes a machine from the pool, or makes one.
  static MachineLease get(const CompileOptions &options);

private:
  std::string key;
  std::unique_ptr<llvm::TargetMachine> machine;
};

/// Links from embedded bitcode the functions that `module` declares, made
/// internal; `bitcode` is asked for if there are any. Throws if it is
/// malformed.
void linkBitcode(llvm::Module &module,
                 llvm::function_ref<llvm::StringRef()> bitcode,
                 llvm::StringRef name);

/// Links the functions of NativeCode.h that `module`, for CPUs, declares.
/// Throws if the process does not know one, or cannot compile it.
void linkNativeCode(llvm::Module &module);
/// Declares functions of the device library that functions of NativeCode.h call
/// in PTX, so that `module`, for GPUs, gets them. Throws like `linkNativeCode`.
void declareForNativeCode(llvm::Module &module, const std::string &target);
/// Keeps calls of those that `module`, for GPUs, declares where they stand.
void keepNativeCalls(llvm::Module &module);
/// PTX with the functions that it declares. Throws like `linkNativeCode`.
std::string joinNativePtx(std::string ptx, const std::string &target);

/// Runs the optimiser. `hasLanes`: threads are lanes of vectors already;
/// `brief`: without what takes long for a few percent.
void optimize(llvm::Module &module, llvm::TargetMachine &machine,
              const CompileOptions &options, bool hasLanes, bool brief);

/// Has scalar code branch where an index counts from the end of an array.
void branchOnIndices(llvm::Module &module);

/// Works around an error of InstCombine: see MaskedLoads.cpp.
void keepLoadsBeforeStores(llvm::PassInstrumentationCallbacks &callbacks);

/// Emits an object file (CPU), or PTX or assembly text.
llvm::SmallVector<char, 0> emit(llvm::Module &module,
                                llvm::TargetMachine &machine,
                                const TargetInfo &target, llvm::StringRef entry,
                                bool asText, bool brief);

} // namespace warp

#endif // WARP_LIB_COMPILER_TARGET_H

//===- SavedModule.h - Ahead-of-time compiled kernels -----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A saved module is one file with the code of some kernels. A program loads it
// and launches them without Python and without compiling anything:
//
//   auto module = warp::SavedModule::load("particles.cpu.warp");
//   auto kernel = module.kernel("integrate");
//   warp::launch(*kernel, warp::cpuDevice, {n}, x, v, dt);
//
// The file, numbers little-endian, strings behind their length (64 bits):
//
//   magic "WARPSAVE" | format version (32 bits) | length of the payload
//   | hash of the payload | payload
//
// The payload is the release that wrote it, the module's name and the kernels:
// each with its target ("cpu", "sm_90"), the processor or driver it was made
// for, a hash of its source, its options, its parameters (name, kind, type,
// place in the parameter block), how it accesses arrays, which words are ids of
// geometry, and its variants: the launches they fit and their code, an ELF
// object, PTX text or a cubin.
//
// Several variants of a kernel are saved, the fastest first: for packed arrays
// and 32-bit indices, and for any launch of the kernel's number of dimensions.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_SAVEDMODULE_H
#define WARP_SAVEDMODULE_H

#include "warp/Compile.h"
#include "warp/Export.h"
#include "warp/Kernel.h"

#include <map>
#include <memory>
#include <string>
#include <vector>

namespace warp {

/// Code and the launches that it fits: those with the same rank and block, whose
/// arguments have all bits of `packed` and `nonNegative` and which have each of the other facts
/// that the code counts on (KernelSaved.cpp). Code that keeps the order of
/// threads serves launches that do not ask for it as well.
struct SavedVariant : LaunchFacts {
  Code code;
};

/// A kernel's code for one target.
struct SavedKernel {
  std::string name;
  /// "cpu", or the GPU architecture, "sm_90".
  std::string target;
  /// CPU: name and features of the processor that the code is for.
  std::string processor;
  /// Hash of the kernel before it was compiled.
  std::string source;
  KernelOptions options;
  std::vector<Param> params;
  std::vector<Access> accesses;
  std::vector<IdFlow> idFlows;
  std::vector<SavedVariant> variants;
};

/// A file in memory; one thread at a time. Its kernels outlive it, and any
/// number of threads may launch them.
class WARP_API SavedModule {
public:
  SavedModule() = default;

  /// Reads a file. Throws if there is none, or if it is damaged or was written
  /// by a release with another format.
  static SavedModule load(const std::string &path);
  /// Writes the file in one step: others see the old one or the new one.
  void save(const std::string &path) const;

  /// The file format, exposed for tests; `origin` is named in errors.
  std::string bytes() const;
  static SavedModule fromBytes(const std::string &bytes,
                               const std::string &origin);

  std::vector<std::string> kernelNames() const;
  /// The kernel of a name, for all targets that the file has; the same one each
  /// time. Throws if there is none.
  std::shared_ptr<Kernel> kernel(const std::string &name);

  std::string name;
  std::vector<SavedKernel> kernels;

private:
  std::map<std::string, std::shared_ptr<Kernel>> loaded;
};

/// Throws if a kernel saved for the CPU needs instructions that this processor
/// does not have.
WARP_API void checkProcessor(const SavedKernel &saved);

} // namespace warp

#endif // WARP_SAVEDMODULE_H

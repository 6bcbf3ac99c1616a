//===- Code.h - CUDA modules: load, link, launch ----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// PTX goes to the driver as it is, which compiles a program as a whole and
// keeps the machine code in a cache of its own. Its linker, the one way to get
// machine code out of it, compiles PTX as a part of programs to come: kernels
// take more registers, and what divides in place is called (H200: rays 1.17
// times slower). So that is for code in files, and for quickly compiled kernels
// that call the assembled library (FirstCode.h).
//
// Several threads compile at a time if code is loaded as libraries, which
// drivers before CUDA 12 do not know; they load modules, one after the other.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_CUDA_CODE_H
#define WARP_LIB_RUNTIME_CUDA_CODE_H

#include "Driver.h"
#include "warp/Compile.h"

namespace warp {

/// PTX or machine code that the driver has loaded; unloading it is up to the
/// owner.
class CudaCode {
public:
  /// Loads for the current context. Throws what the driver says against it.
  void load(Code &code);
  /// Throws if there is no such kernel.
  cuda::Function function(const std::string &name) const;
  void unload();
  explicit operator bool() const { return library || module; }

private:
  cuda::LibraryHandle library = nullptr;
  cuda::ModuleHandle module = nullptr;
};

/// An attribute of a kernel, in the current context.
int attributeOf(cuda::Function function, cuda::FunctionAttribute which);

/// True if the kernel waits for the one before it on its stream, so that it may
/// be started before that has ended.
bool waitsForPredecessor(const Code &code);

/// Queues a kernel. One that waits for the kernel before it on its stream is
/// started while that ends, which saves some of the time between them. Where
/// the one before is no kernel, or the stream is the legacy one, the driver
/// waits as ever.
/// config: all but attributes.
cuda::Result queueKernel(cuda::Function function, cuda::LaunchConfig config,
                         void **arguments, bool waits);

/// "sm_90a" of PTX.
std::string targetOf(const Code &code);

/// True if the PTX calls functions of the assembled library.
bool callsLibrary(const Code &code);

} // namespace warp

#endif // WARP_LIB_RUNTIME_CUDA_CODE_H

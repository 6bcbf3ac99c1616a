//===- CudaKernels.cpp - Kernels of the library itself --------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "CudaKernels.h"

#include "GraphDriver.h"

#include <map>
#include <mutex>
#include <utility>

using namespace warp;

/// PTX of one kernel of a file: the driver would compile all of them. For GPUs
/// from sm_90 on it begins with the instruction that waits for the kernel
/// before it on its stream, and then lets the one after it start where there is
/// room, which waits in turn.
static std::string textOf(std::string file, const std::string &name,
                          bool waits) {
  static const std::string target = ".target sm_", entry = ".visible .entry ",
                           open = "\n{\n", close = "\n}\n",
                           wait = "\tgriddepcontrol.wait;\n"
                                  "\tgriddepcontrol.launch_dependents;\n";
  size_t at = file.find(target) + target.size();
  if (waits)
    file.replace(at, 2, "90");
  while ((at = file.find(entry, at)) != file.npos) {
    size_t end = file.find(close, at) + close.size();
    if (file.compare(at + entry.size(), name.size() + 1, name + "(") != 0) {
      file.erase(at, end - at);
      continue;
    }
    size_t begin = file.find(open, at) + open.size();
    if (waits)
      file.insert(begin, wait);
    at = begin;
  }
  return file;
}

LibraryKernel warp::kernelOf(int device, const char *file,
                             const std::string &name) {
  static std::mutex mutex;
  static auto *kernels =
      new std::map<std::pair<int, std::string>, LibraryKernel>;
  std::lock_guard<std::mutex> lock(mutex);
  LibraryKernel &kernel = (*kernels)[{device, name}];
  if (kernel.function)
    return kernel;
  bool waits =
      cuda::driver()->hasProgrammaticLaunches && deviceInfo(device).arch >= 90;
  cuda::RelaxedCaptures relaxed;
  cuda::ModuleHandle module = nullptr;
  WARP_CUDA(moduleLoadDataEx, &module, textOf(file, name, waits).c_str(), 0,
            nullptr, nullptr);
  WARP_CUDA(moduleGetFunction, &kernel.function, module, name.c_str());
  kernel.waits = waits;
  return kernel;
}

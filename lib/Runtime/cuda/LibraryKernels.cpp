//===- LibraryKernels.cpp - Precompiled runtime kernels -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "LibraryKernels.h"

#include "GraphDriver.h"
#include "warp/Forks.h"
#include "warp/LibraryCode.h"

#include <map>
#include <utility>

using namespace warp;

/// PTX of one kernel of a file: the driver would compile all of them. For GPUs
/// from sm_90 on it begins with the instruction that waits for the kernel
/// before it on its stream, as all kernels do (decision 0022).
static std::string textOf(std::string file, const std::string &name,
                          bool waits) {
  static const std::string target = ".target sm_", entry = ".visible .entry ",
                           open = "\n{\n", close = "\n}\n",
                           wait = "\tgriddepcontrol.wait;\n";
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

namespace {
/// The part of a file of kernels that one device has loaded.
struct KernelFile {
  /// All of them, if they come as machine code that the driver takes.
  cuda::ModuleHandle assembled = nullptr;
  std::string text;
};
} // namespace

static KernelFile open(int device, const std::string &file) {
  KernelFile result;
  std::vector<char> code = assembledKernels(file, deviceInfo(device).arch);
  if (!code.empty() &&
      cuda::driver()->moduleLoadDataEx(&result.assembled, code.data(), 0,
                                       nullptr, nullptr) != cuda::success)
    result.assembled = nullptr;
  return result;
}

static cuda::Function load(KernelFile &file, const std::string &fileName,
                           const std::string &name, bool waits) {
  cuda::Function function = nullptr;
  if (file.assembled &&
      cuda::driver()->moduleGetFunction(&function, file.assembled,
                                        name.c_str()) == cuda::success)
    return function;
  if (file.text.empty())
    file.text = kernelText(fileName);
  cuda::ModuleHandle module = nullptr;
  WARP_CUDA(moduleLoadDataEx, &module, textOf(file.text, name, waits).c_str(),
            0, nullptr, nullptr);
  WARP_CUDA(moduleGetFunction, &function, module, name.c_str());
  return function;
}

LibraryKernel warp::kernelOf(int device, const char *file,
                             const std::string &name) {
  static ForkMutex mutex;
  static auto *files = new std::map<std::pair<int, std::string>, KernelFile>;
  static auto *kernels =
      new std::map<std::pair<int, std::string>, LibraryKernel>;
  std::lock_guard lock(mutex);
  LibraryKernel &kernel = (*kernels)[{device, name}];
  if (kernel.function)
    return kernel;
  cuda::RelaxedCaptures relaxed;
  auto [entry, isNew] = files->try_emplace({device, file});
  if (isNew)
    entry->second = open(device, file);
  bool waits =
      cuda::driver()->hasProgrammaticLaunches && deviceInfo(device).arch >= 90;
  kernel.function = load(entry->second, file, name, waits);
  kernel.waits = waits;
  return kernel;
}

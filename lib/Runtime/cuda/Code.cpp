//===- Code.cpp - CUDA modules: load, link, launch ------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Code.h"

#include "Device.h"
#include "Runtime/LaunchQueue.h"
#include "Support.h"
#include "warp/Error.h"
#include "warp/LibraryCode.h"

#include <algorithm>
#include <string_view>
#include <utility>

using namespace warp;

namespace {
/// The buffer for what the driver finds wrong with PTX, as options of a call.
struct Log {
  char text[4096] = {};
  int options[2] = {cuda::jitErrorLogBuffer, cuda::jitErrorLogBufferSizeBytes};
  void *values[2] = {text, reinterpret_cast<void *>(sizeof(text) - 1)};
};
} // namespace

[[noreturn]] static void rejected(cuda::Result result, const Code &code,
                                  const char *log) {
  const char *name = nullptr;
  cuda::driver()->getErrorName(result, &name);
  throw Error(Error::Kind::Compile,
              "the CUDA driver rejects the code of '" + code.entry +
                  "': " + (name ? name : "unknown error") +
                  (log[0] ? std::string("\n") + log : ""));
}

void CudaCode::load(Code &code) {
  const cuda::Driver &driver = *cuda::driver();
  // The driver wants a terminated string.
  if (code.binary.empty() || code.binary.back() != '\0')
    code.binary.push_back('\0');
  Log log;
  cuda::Result result =
      driver.hasLibraries
          ? driver.libraryLoadData(&library, code.binary.data(), log.options,
                                   log.values, 2, nullptr, nullptr, 0)
          : driver.moduleLoadDataEx(&module, code.binary.data(), 2, log.options,
                                    log.values);
  if (result != cuda::success)
    rejected(result, code, log.text);
}

cuda::Function CudaCode::function(const std::string &name) const {
  cuda::Function found = nullptr;
  if (!library) {
    WARP_CUDA(moduleGetFunction, &found, module, name.c_str());
    return found;
  }
  cuda::KernelHandle kernel = nullptr;
  WARP_CUDA(libraryGetKernel, &kernel, library, name.c_str());
  WARP_CUDA(kernelGetFunction, &found, kernel);
  return found;
}

int warp::attributeOf(cuda::Function function, cuda::FunctionAttribute which) {
  int value = 0;
  WARP_CUDA(funcGetAttribute, &value, which, function);
  return value;
}

void CudaCode::unload() {
  if (library)
    cuda::driver()->libraryUnload(std::exchange(library, nullptr));
  if (module)
    cuda::driver()->moduleUnload(std::exchange(module, nullptr));
}

static std::string_view textOf(const Code &code) {
  return {code.binary.data(), code.binary.size()};
}

bool warp::waitsForPredecessor(const Code &code) {
  std::string_view text = textOf(code);
  return !isElf(code.binary) && text.find("griddepcontrol.wait") != text.npos;
}

bool warp::callsLibrary(const Code &code) {
  std::string_view text = textOf(code);
  return !isElf(code.binary) && text.find("\n.extern .func warp_") != text.npos;
}

std::string warp::targetOf(const Code &code) {
  static constexpr std::string_view before = "\n.target ";
  std::string_view text = textOf(code);
  text.remove_prefix(std::min(text.find(before), text.size() - before.size()) +
                     before.size());
  return std::string(text.substr(0, text.find_first_of(", \n")));
}

cuda::Result warp::queueKernel(cuda::Function function,
                               cuda::LaunchConfig config, void **arguments,
                               bool waits) {
  static constexpr cuda::LaunchAttribute attribute{
      cuda::launchProgrammatic, 0, {1}};
  const auto &grid = config.grid, &block = config.block;
  if (!waits || !config.stream)
    return cuda::driver()->launchKernel(
        function, grid[0], grid[1], grid[2], block[0], block[1], block[2],
        config.sharedBytes, config.stream, arguments, nullptr);
  config.attributes = &attribute;
  config.attributeCount = 1;
  return cuda::driver()->launchKernelEx(&config, function, arguments, nullptr);
}

void CudaDevice::assemble(Code &code) {
  BehindNothing exempt;
  cuda::ContextScope scope(index);
  const cuda::Driver &driver = *cuda::driver();
  std::string ptx(code.binary.begin(), code.binary.end());
  Log log;
  struct Link {
    cuda::LinkHandle handle = nullptr;
    ~Link() {
      if (handle)
        cuda::driver()->linkDestroy(handle);
    }
  } link;
  void *cubin = nullptr;
  size_t size = 0;
  cuda::Result result =
      driver.linkCreate(2, log.options, log.values, &link.handle);
  if (result == cuda::success)
    result = driver.linkAddData(link.handle, cuda::jitInputPtx, ptx.data(),
                                ptx.size() + 1, code.entry.c_str(), 0, nullptr,
                                nullptr);
  if (callsLibrary(code))
    for (const std::vector<char> &object : assembledLibrary(targetOf(code)))
      if (result == cuda::success)
        result = driver.linkAddData(
            link.handle, cuda::jitInputCubin, const_cast<char *>(object.data()),
            object.size(), "device library", 0, nullptr, nullptr);
  if (result == cuda::success)
    result = driver.linkComplete(link.handle, &cubin, &size);
  if (result != cuda::success)
    rejected(result, code, log.text);
  auto *bytes = static_cast<const char *>(cubin);
  code.binary.assign(bytes, bytes + size);
}

//===- AssembledLibrary.cpp - The device library as GPU code --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "AssembledLibrary.h"

#include "Compiler/Embedded.h"

#include "WarpDialect/LibraryOps.h"
#include "warp/Forks.h"
#include "warp/LibraryCode.h"

#include "llvm/ADT/StringSwitch.h"
#include "llvm/IR/Module.h"
#include "llvm/Object/Archive.h"
#include "llvm/Support/MemoryBuffer.h"

#include <map>

using namespace warp;

// lib/DeviceLib/CMakeLists.txt makes them: compressed archives; the objects for
// the architectures of a family are much alike.
WARP_EMBEDDED(devicelib_ampere)
WARP_EMBEDDED(devicelib_hopper)
WARP_EMBEDDED(devicelib_blackwell)
WARP_EMBEDDED(kernels_ampere)
WARP_EMBEDDED(kernels_hopper)
WARP_EMBEDDED(kernels_ptx)

static llvm::StringRef libraryFor(llvm::StringRef target) {
  return llvm::StringSwitch<llvm::StringRef>(target)
      .Cases({"sm_80", "sm_86", "sm_89"}, devicelib_ampere())
      .Case("sm_90a", devicelib_hopper())
      .Cases({"sm_100", "sm_120"}, devicelib_blackwell())
      .Default({});
}

/// True if the objects for a target have products of tiles.
static bool hasProducts(llvm::StringRef target) { return target == "sm_90a"; }

bool warp::hasAssembledLibrary(const std::string &target) {
  return !libraryFor(target).empty();
}

/// Members of an archive whose names begin like that; none if it cannot be
/// read: kernels have their own code then.
static std::vector<std::vector<char>> unpack(llvm::StringRef archive,
                                             llvm::StringRef prefix) {
  std::vector<char> bytes = decompress(archive);
  if (bytes.empty())
    return {};
  auto opened = llvm::object::Archive::create(
      {llvm::StringRef(bytes.data(), bytes.size()), "device library"});
  if (!opened) {
    llvm::consumeError(opened.takeError());
    return {};
  }
  std::vector<std::vector<char>> found;
  llvm::Error error = llvm::Error::success();
  for (const auto &child : (*opened)->children(error)) {
    auto name = child.getName();
    auto content = child.getBuffer();
    if (name && content && name->starts_with(prefix))
      found.emplace_back(content->begin(), content->end());
    llvm::consumeError(name.takeError());
    llvm::consumeError(content.takeError());
  }
  llvm::consumeError(std::move(error));
  return found;
}

const std::vector<std::vector<char>> &
warp::assembledLibrary(const std::string &target) {
  static ForkMutex mutex;
  static auto *known =
      new std::map<std::string, std::vector<std::vector<char>>>;
  std::lock_guard guard(mutex);
  auto [entry, isNew] = known->try_emplace(target);
  if (isNew)
    entry->second = unpack(libraryFor(target), target + ".");
  return entry->second;
}

std::vector<char> warp::assembledKernels(const std::string &file, int arch) {
  // Whole programs run on all later GPUs of their generation.
  int generation = arch / 10;
  llvm::StringRef archive = generation == 8   ? kernels_ampere()
                            : generation == 9 ? kernels_hopper()
                                              : llvm::StringRef();
  auto found =
      unpack(archive, "sm_" + std::to_string(generation) + "0." + file + ".");
  return found.empty() ? std::vector<char>() : std::move(found.front());
}

std::string warp::kernelText(const std::string &file) {
  auto found = unpack(kernels_ptx(), file + ".");
  return found.empty()
             ? ""
             : std::string(found.front().begin(), found.front().end());
}

/// How the archive for a target has a function.
static LibraryFunction::Assembly assemblyOf(llvm::StringRef symbol,
                                            llvm::StringRef target) {
  const LibraryFunction *function = findLibraryFunction(symbol);
  return function && (!function->isProduct || hasProducts(target))
             ? function->assembly
             : LibraryFunction::Assembly::None;
}

bool warp::isAssembled(llvm::StringRef symbol, llvm::StringRef target) {
  return hasAssembledLibrary(target.str()) &&
         assemblyOf(symbol, target) != LibraryFunction::Assembly::None;
}

bool warp::callsAssembled(const llvm::Module &module, llvm::StringRef target) {
  return llvm::any_of(module, [&](const llvm::Function &function) {
    return function.isDeclaration() && assemblyOf(function.getName(), target) ==
                                           LibraryFunction::Assembly::Long;
  });
}

static constexpr llvm::StringLiteral hidden = "assembled.";

AssembledCalls::AssembledCalls(llvm::Module &module, llvm::StringRef target)
    : module(module) {
  for (llvm::Function &function : module)
    if (function.isDeclaration() && isAssembled(function.getName(), target)) {
      // Threads may meet in them.
      function.setConvergent();
      function.setName(hidden + function.getName());
    }
}

bool AssembledCalls::isKept(const llvm::Function &function) {
  return function.getName().starts_with(hidden);
}

AssembledCalls::~AssembledCalls() {
  for (llvm::Function &function : module)
    if (isKept(function))
      function.setName(function.getName().drop_front(hidden.size()));
}

//===- AssembledLibrary.cpp - The device library as GPU code --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "AssembledLibrary.h"

#include "warp/FirstCode.h"

#include "llvm/ADT/StringSwitch.h"
#include "llvm/IR/Module.h"
#include "llvm/Object/Archive.h"
#include "llvm/Support/MemoryBuffer.h"

#include <map>
#include <mutex>
#include <zstd.h>

using namespace warp;

// lib/DeviceLib/CMakeLists.txt makes them: archives, compressed, of objects for
// each architecture of a family, which are much alike.
#define WARP_FAMILY(family)                                                    \
  extern "C" const char warp_devicelib_##family##_begin[],                     \
      warp_devicelib_##family##_end[];
WARP_FAMILY(ampere)
WARP_FAMILY(hopper)
WARP_FAMILY(blackwell)
#undef WARP_FAMILY

static llvm::StringRef archiveFor(llvm::StringRef target) {
  auto bytes = [](const char *begin, const char *end) {
    return llvm::StringRef(begin, size_t(end - begin));
  };
  return llvm::StringSwitch<llvm::StringRef>(target)
      .Cases({"sm_80", "sm_86", "sm_89"},
             bytes(warp_devicelib_ampere_begin, warp_devicelib_ampere_end))
      .Case("sm_90a",
            bytes(warp_devicelib_hopper_begin, warp_devicelib_hopper_end))
      .Cases({"sm_100", "sm_120"}, bytes(warp_devicelib_blackwell_begin,
                                         warp_devicelib_blackwell_end))
      .Default({});
}

bool warp::hasAssembledLibrary(const std::string &target) {
  return !archiveFor(target).empty();
}

/// Members of an archive whose names begin like that; none if it cannot be
/// read: kernels have their own code then.
static std::vector<std::vector<char>> unpack(llvm::StringRef archive,
                                             llvm::StringRef prefix) {
  auto size = ZSTD_getFrameContentSize(archive.data(), archive.size());
  if (archive.empty() || size > (1u << 30))
    return {};
  std::vector<char> bytes(size);
  if (ZSTD_decompress(bytes.data(), size, archive.data(), archive.size()) !=
      size)
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
  static std::mutex mutex;
  static auto *known =
      new std::map<std::string, std::vector<std::vector<char>>>;
  std::lock_guard<std::mutex> guard(mutex);
  auto [entry, isNew] = known->try_emplace(target);
  if (isNew)
    entry->second = unpack(archiveFor(target), target + ".");
  return entry->second;
}

bool warp::isAssembled(llvm::StringRef symbol) {
  for (llvm::StringRef group :
       {"warp_mesh_", "warp_overlap_next", "warp_tile_factor_",
        "warp_tile_differentiate_factor_", "warp_tile_substitute_",
        "warp_tile_transform_"})
    if (symbol.starts_with(group))
      return true;
  return false;
}

static bool isCall(const llvm::Function &function) {
  return function.isDeclaration() && isAssembled(function.getName());
}

bool warp::callsAssembled(const llvm::Module &module) {
  return llvm::any_of(module, isCall);
}

static constexpr llvm::StringLiteral hidden = "assembled.";

AssembledCalls::AssembledCalls(llvm::Module &module) : module(module) {
  for (llvm::Function &function : module)
    if (isCall(function)) {
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

//===- NativeCode.cpp - Functions that users wrote in C++ -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "warp/NativeCode.h"

#include "LibmNames.h"
#include "Target.h"

#include "warp/Error.h"

#include "llvm/ADT/StringMap.h"
#include "llvm/ADT/StringSet.h"
#include "llvm/IR/Module.h"

#include <mutex>

namespace {
struct Registry {
  std::mutex mutex;
  llvm::StringMap<std::string> code;

  static Registry &get() {
    static Registry registry;
    return registry;
  }
};
} // namespace

void warp::addNativeCode(const std::string &symbol, std::string bitcode) {
  Registry &registry = Registry::get();
  std::lock_guard<std::mutex> guard(registry.mutex);
  registry.code[symbol] = std::move(bitcode);
}

static llvm::SmallVector<std::string> missingNames(llvm::Module &module) {
  llvm::SmallVector<std::string> names;
  for (llvm::Function &function : module)
    if (function.isDeclaration() &&
        function.getName().starts_with(warp::nativeCodePrefix))
      names.push_back(function.getName().str());
  return names;
}

static const llvm::StringSet<> &libmNames() {
  static const llvm::StringSet<> names = {
#define BOTH(name) #name "f", #name,
#define ONE(name) #name,
      WARP_LIBM_UNARY(BOTH) WARP_LIBM_BINARY(BOTH) WARP_LIBC_MEMORY(ONE)
#undef BOTH
#undef ONE
  };
  return names;
}

/// Several functions may ask for the same one.
static void renameLibm(llvm::Module &module) {
  for (llvm::Function &function : llvm::make_early_inc_range(module)) {
    if (!function.isDeclaration() || !libmNames().contains(function.getName()))
      continue;
    std::string name = (warp::libmPrefix + function.getName()).str();
    if (llvm::Function *known = module.getFunction(name)) {
      function.replaceAllUsesWith(known);
      function.eraseFromParent();
    } else {
      function.setName(name);
    }
  }
}

void warp::linkNativeCode(llvm::Module &module) {
  for (const std::string &name : missingNames(module)) {
    Registry &registry = Registry::get();
    std::lock_guard<std::mutex> guard(registry.mutex);
    auto found = registry.code.find(name);
    if (found == registry.code.end())
      throw Error(Error::Kind::Compile,
                  "the code of native function '" + name +
                      "' is not known in this process: import the module that "
                      "defines it");
    linkBitcode(module, found->second, "native function");
    renameLibm(module);
  }
}

void warp::refuseNativeCode(llvm::Module &module) {
  if (!missingNames(module).empty())
    throw Error(Error::Kind::Compile,
                "the kernel calls a native function, which is compiled for "
                "CPUs only; write it in Python with `@wp.func`");
}

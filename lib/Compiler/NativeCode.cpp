//===- NativeCode.cpp - User functions in C++ -----------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "warp/NativeCode.h"
#include "warp/Forks.h"

#include "NativeCompilers.h"
#include "Target.h"

#include "Support/LibmNames.h"

#include "warp/Error.h"

#include "llvm/ADT/StringExtras.h"
#include "llvm/ADT/StringMap.h"
#include "llvm/ADT/StringSet.h"
#include "llvm/IR/Module.h"
#include "llvm/Transforms/Utils/ModuleUtils.h"

#include <stdexcept>

using llvm::StringRef;

namespace {

struct Known {
  warp::NativeCode code;
  /// The compilers' results, by target; "" is the host.
  llvm::StringMap<std::string> made;
};

struct Registry {
  warp::ForkMutex mutex;
  llvm::StringMap<Known> functions;

  static Registry &get() {
    static Registry registry;
    return registry;
  }

  /// Bitcode for the host, or PTX for an architecture.
  const std::string &compiled(StringRef symbol, const std::string &target) {
    std::lock_guard guard(mutex);
    auto found = functions.find(symbol);
    if (found == functions.end())
      throw warp::Error(warp::Error::Kind::Compile,
                        "the code of native function '" + symbol.str() +
                            "' is not known in this process: import the module "
                            "that defines it");
    auto &[code, made] = found->second;
    auto [entry, isNew] = made.try_emplace(target);
    if (!isNew)
      return entry->second;
    try {
      entry->second = target.empty() ? warp::compileForCpu(code)
                                     : warp::compileForGpu(code, target);
    } catch (const std::runtime_error &problem) {
      made.erase(entry);
      auto [before, after] = StringRef(code.place).split('%');
      throw warp::Error(warp::Error::Kind::Compile,
                        (before + problem.what() + after).str());
    }
    return entry->second;
  }
};

} // namespace

void warp::addNativeCode(const std::string &symbol, NativeCode code) {
  Registry &registry = Registry::get();
  std::lock_guard guard(registry.mutex);
  registry.functions[symbol].code = std::move(code);
}

static llvm::SmallVector<std::string> missingNames(llvm::Module &module) {
  llvm::SmallVector<std::string> names;
  for (llvm::Function &function : module)
    if (function.isDeclaration() &&
        function.getName().starts_with(warp::nativeCodePrefix))
      names.push_back(function.getName().str());
  return names;
}

//===----------------------------------------------------------------------===//
// CPUs
//===----------------------------------------------------------------------===//

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
    linkBitcode(
        module,
        [&]() -> llvm::StringRef { return Registry::get().compiled(name, ""); },
        "native function");
    renameLibm(module);
  }
}

//===----------------------------------------------------------------------===//
// GPUs
//===----------------------------------------------------------------------===//

/// The function that a line of PTX declares to be elsewhere; empty for others.
static StringRef externalName(StringRef line) {
  if (!line.consume_front(".extern .func"))
    return "";
  return line.ltrim().take_until([](char c) { return c == '(' || c == ' '; });
}

/// True if the device library has it.
static bool isOfLibrary(StringRef name) {
  return name.starts_with("warp_") && !name.starts_with(warp::nativeCodePrefix);
}

void warp::declareForNativeCode(llvm::Module &module,
                                const std::string &target) {
  llvm::SmallVector<llvm::GlobalValue *> used;
  for (const std::string &name : missingNames(module))
    for (StringRef line :
         llvm::split(Registry::get().compiled(name, target), '\n'))
      if (StringRef wanted = externalName(line); isOfLibrary(wanted))
        used.push_back(llvm::cast<llvm::GlobalValue>(
            module
                .getOrInsertFunction(wanted,
                                     llvm::Type::getVoidTy(module.getContext()))
                .getCallee()));
  // Functions that no kernel calls keep their parameters for later callers.
  if (!used.empty())
    llvm::appendToCompilerUsed(module, used);
}

void warp::keepNativeCalls(llvm::Module &module) {
  // They may contain barriers.
  for (const std::string &name : missingNames(module))
    module.getFunction(name)->setConvergent();
}

static bool isPartOfName(char c) {
  return llvm::isAlnum(c) || c == '_' || c == '$';
}

/// The name that a line of PTX defines for the whole file: a function or a
/// variable; empty for others.
static StringRef definedName(StringRef line) {
  for (StringRef linkage : {".visible ", ".weak "})
    line.consume_front(linkage);
  if (line.consume_front(".func")) {
    line = line.ltrim();
    if (line.starts_with("("))
      line = line.split(')').second.ltrim();
    return line.take_while(isPartOfName);
  }
  if (!line.starts_with(".global") && !line.starts_with(".const"))
    return "";
  line =
      line.take_until([](char c) { return c == '[' || c == '=' || c == ';'; });
  return line.rtrim().rsplit(' ').second;
}

/// Names of `text` with an ending, if `names` has them.
static std::string rename(StringRef text, const llvm::StringSet<> &names,
                          StringRef ending) {
  std::string result;
  while (!text.empty()) {
    StringRef name = text.take_while(isPartOfName);
    result += name;
    if (names.contains(name))
      result += ending;
    text = text.drop_front(name.size());
    StringRef between = text.take_until(isPartOfName);
    result += between;
    text = text.drop_front(between.size());
  }
  return result;
}

/// The definitions in the PTX of a function, for other PTX. The kernel's own
/// version stands: it is one that the driver knows, and code that needs a later
/// one is named by the assembler. Helpers of NVRTC get names of their own.
static std::string definitionsOf(StringRef ptx, StringRef symbol) {
  std::string body;
  llvm::StringSet<> names;
  for (StringRef line : llvm::split(ptx, '\n')) {
    if (line.starts_with(".version") || line.starts_with(".target") ||
        line.starts_with(".address_size") || line.starts_with("//"))
      continue;
    if (StringRef name = definedName(line); !name.empty() && name != symbol)
      names.insert(name);
    // The kernel's text defines it.
    if (isOfLibrary(externalName(line)))
      line = line.drop_front(strlen(".extern "));
    // Nobody outside calls it.
    if (line.starts_with(".visible .func"))
      line = line.drop_front(strlen(".visible "));
    body += "\n" + line.str();
  }
  std::string ending = symbol.take_back(24).str();
  return rename(body, names, "_" + ending);
}

std::string warp::joinNativePtx(std::string ptx, const std::string &target) {
  static constexpr char declaration[] = "\n.extern .func ";
  size_t begin = 0;
  while ((begin = ptx.find(declaration, begin)) != std::string::npos) {
    size_t end = ptx.find(';', begin);
    StringRef rest = StringRef(ptx).slice(begin + strlen(declaration), end);
    StringRef name = rest.take_until(
        [](char c) { return c == '(' || c == ' ' || c == '\n'; });
    if (!name.starts_with(nativeCodePrefix)) {
      begin = end;
      continue;
    }
    // The definition takes the place of the declaration.
    std::string body =
        definitionsOf(Registry::get().compiled(name, target), name);
    ptx.replace(begin, end + 1 - begin, body);
    begin += body.size();
  }
  return ptx;
}

//===- Module.cpp - Modules as text ---------------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "BuilderImpl.h"
#include "Compilation.h"

#include "WarpDialect/WarpDialect.h"

#include "mlir/Parser/Parser.h"

#include "llvm/ADT/StringMap.h"
#include "llvm/Support/raw_ostream.h"

using namespace mlir;

func::FuncOp warp::findMarked(ModuleOp module, StringRef attribute) {
  for (auto function : module.getOps<func::FuncOp>())
    if (function->hasAttr(attribute))
      return function;
  return nullptr;
}

func::FuncOp warp::kernelOf(ModuleOp module) {
  if (func::FuncOp kernel = findMarked(module, kernelAttrName))
    return kernel;
  throw Error(Error::Kind::Compile, "the module has no kernel");
}

warp::Module warp::Module::fromText(std::string_view text) {
  ContextLock lock;
  Diagnostics diagnostics;
  auto impl = std::make_shared<Impl>();
  impl->op = parseSourceString<ModuleOp>(StringRef(text.data(), text.size()),
                                         &compilerContext(), "<ir>");
  if (!impl->op)
    throw diagnostics.toError(Error::Kind::Parse, "malformed IR text");
  return Module(std::move(impl));
}

/// True if a struct or table goes by a name that is printed at the top.
static bool hasNames(ModuleOp module) {
  llvm::SmallDenseMap<Type, bool, 32> known;
  auto isNamed = [&](Type type) {
    auto [found, isNew] = known.try_emplace(type, false);
    if (isNew)
      found->second =
          type.walk([](warp::StructType) { return WalkResult::interrupt(); })
              .wasInterrupted();
    return found->second;
  };
  return module
      .walk([&](Operation *op) {
        bool isFound = isa<warp::TableGetOp>(op) ||
                       llvm::any_of(op->getResultTypes(), isNamed);
        for (Region &region : op->getRegions())
          for (Block &block : region)
            isFound |= llvm::any_of(block.getArgumentTypes(), isNamed);
        return isFound ? WalkResult::interrupt() : WalkResult::advance();
      })
      .wasInterrupted();
}

/// The length of the quoted string at whose first quote `text` begins.
static size_t endOfString(StringRef text) {
  size_t i = 1;
  while (i < text.size() && text[i] != '"')
    i += text[i] == '\\' ? 2 : 1;
  return std::min(i + 1, text.size());
}

/// The length of the parentheses with the first of which `text` begins.
static size_t endOfParentheses(StringRef text) {
  size_t i = 0;
  for (int open = 0; i < text.size(); ++i) {
    if (text[i] == '"')
      i += endOfString(text.drop_front(i)) - 1;
    else if (text[i] == '(')
      ++open;
    else if (text[i] == ')' && --open == 0)
      return i + 1;
  }
  return i;
}

static bool isBorder(char c) { return c == '"' || c == ' ' || c == '\n'; }

std::string
warp::replaceLocations(StringRef text,
                       function_ref<void(StringRef, std::string &)> replace) {
  constexpr StringRef mark = " loc(", alias = "#loc";
  std::string replaced;
  replaced.reserve(text.size());
  while (!text.empty()) {
    bool isLine = replaced.empty() || replaced.back() == '\n';
    size_t length = 1;
    if (isLine && text.starts_with(alias)) {
      text = text.drop_front(std::min(text.find('\n'), text.size() - 1) + 1);
      continue;
    }
    if (text.front() == '"')
      length = endOfString(text);
    else if (text.starts_with(mark)) {
      size_t open = mark.size() - 1;
      length = open + endOfParentheses(text.drop_front(open));
      replace(text.take_front(length), replaced);
      text = text.drop_front(length);
      continue;
    } else if (text.front() != '\n') {
      StringRef rest = text.drop_front();
      length = 1 + std::min(rest.find_if(isBorder), rest.size());
    }
    replaced.append(text.data(), length);
    text = text.drop_front(length);
  }
  return replaced;
}

/// A text whose operations have their locations in place, with each location
/// once, at the end, as it is printed with names: the text is half as long.
static std::string withNamedLocations(StringRef text) {
  llvm::StringMap<std::string> names;
  std::string definitions;
  auto name = [&](StringRef location, std::string &out) {
    auto [found, isNew] = names.try_emplace(location);
    if (isNew) {
      std::string name = "#loc" + std::to_string(names.size());
      found->second = " loc(" + name + ")";
      definitions += name + " =" + location.str() + "\n";
    }
    out += found->second;
  };
  return warp::replaceLocations(text, name) + definitions;
}

std::string warp::Module::text(bool locations) const {
  ContextLock lock;
  std::string text;
  llvm::raw_string_ostream stream(text);
  // Verified when it was built or parsed; to do it for each print would take
  // longer than the print.
  OpPrintingFlags flags = OpPrintingFlags().assumeVerified();
  if (locations)
    flags.enableDebugInfo();
  // The search for what to name prints every operation once more.
  bool isLocal = !hasNames(*impl->op);
  if (isLocal)
    flags.useLocalScope();
  impl->op->print(stream, flags);
  if (isLocal)
    text += '\n';
  return isLocal && locations ? withNamedLocations(text) : text;
}

std::string warp::Module::kernelName() const {
  ContextLock lock;
  func::FuncOp kernel = findMarked(*impl->op, kernelAttrName);
  return kernel ? kernel.getSymName().str() : std::string();
}

//===- Module.cpp - Modules as text ---------------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "BuilderImpl.h"

#include "WarpDialect/WarpDialect.h"

#include "mlir/Parser/Parser.h"

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

std::string warp::Module::text(bool locations) const {
  ContextLock lock;
  std::string text;
  llvm::raw_string_ostream stream(text);
  // Verified when it was built or parsed; to do it for each print would take
  // longer than the print.
  OpPrintingFlags flags = OpPrintingFlags().assumeVerified();
  if (locations)
    flags.enableDebugInfo();
  impl->op->print(stream, flags);
  return text;
}

std::string warp::Module::kernelName() const {
  ContextLock lock;
  func::FuncOp kernel = findMarked(*impl->op, kernelAttrName);
  return kernel ? kernel.getSymName().str() : std::string();
}

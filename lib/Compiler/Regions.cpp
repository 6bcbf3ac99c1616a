//===- Regions.cpp - Access regions of a kernel's arrays ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Analysis/AccessRegions.h"
#include "Analysis/ArrayOrigins.h"
#include "Context.h"
#include "Pipelines.h"

#include "warp/Compile.h"

#include "WarpDialect/WarpDialect.h"

#include "mlir/Pass/PassManager.h"

#include "llvm/Support/raw_ostream.h"

using namespace mlir;

static func::FuncOp kernelOf(ModuleOp module) {
  for (auto function : module.getOps<func::FuncOp>())
    if (function->hasAttr(warp::kernelAttrName))
      return function;
  throw warp::Error(warp::Error::Kind::Compile, "the module has no kernel");
}

/// True if functions that a kernel calls may access its arrays.
static bool passesArrays(func::FuncOp kernel) {
  auto mayHold = [](Type type) {
    return isa<warp::ArrayType, warp::StructType>(type);
  };
  return kernel
      ->walk([&](func::CallOp call) {
        return llvm::any_of(call.getOperandTypes(), mayHold)
                   ? WalkResult::interrupt()
                   : WalkResult::advance();
      })
      .wasInterrupted();
}

warp::RegionFormula warp::regionFormula(const Module &module) {
  ContextLock lock;
  ModuleOp given = *module.getImpl()->op;
  func::FuncOp kernel = kernelOf(given);
  if (!passesArrays(kernel))
    return findAccessRegions(kernel);
  // Indices are followed in the kernel alone.
  OwningOpRef<ModuleOp> copy = given.clone();
  PassManager pm(&compilerContext());
  addInlining(pm, /*mayKeep=*/true);
  bool isInlined = succeeded(pm.run(*copy));
  return findAccessRegions(isInlined ? kernelOf(*copy) : kernel);
}

//===----------------------------------------------------------------------===//
// Text
//===----------------------------------------------------------------------===//

namespace {

class FormulaPrinter {
public:
  explicit FormulaPrinter(const warp::Module &module)
      : params(warp::parameters(module)),
        leaves(kernelOf(*module.getImpl()->op)),
        formula(warp::regionFormula(module)), stream(text) {}

  std::string run();

private:
  void print(int32_t node);
  void print(const warp::RegionFormula::Index &index);
  StringRef nameAt(int64_t offset) const;

  std::vector<warp::Param> params;
  warp::ArrayLeaves leaves;
  warp::RegionFormula formula;
  std::string text;
  llvm::raw_string_ostream stream;
};

} // namespace

/// The parameter that has a byte of the block.
StringRef FormulaPrinter::nameAt(int64_t offset) const {
  for (const warp::Param &param : params)
    if (param.offset <= offset && offset < param.offset + param.size)
      return param.name;
  return "?";
}

void FormulaPrinter::print(int32_t number) {
  using Op = warp::RegionFormula::Op;
  static constexpr const char *symbols[] = {
      "",    "",      "",      "",    " + ", " - ", " * ",  " / ",  " // ",
      " % ", " min ", " max ", " & ", " | ", " ^ ", " << ", " >> ", ""};
  const warp::RegionFormula::Node &node = formula.nodes[number];
  switch (node.op) {
  case Op::Constant:
    stream << node.a;
    return;
  case Op::Extent:
    stream << "extent(" << node.a << ')';
    return;
  case Op::Argument:
    stream << nameAt(node.a);
    return;
  case Op::ArrayExtent:
    stream << nameAt(node.a) << ".shape[" << node.b << ']';
    return;
  case Op::Cast:
    return print(static_cast<int32_t>(node.a));
  default:
    stream << '(';
    print(static_cast<int32_t>(node.a));
    stream << symbols[static_cast<int>(node.op)];
    print(static_cast<int32_t>(node.b));
    stream << ')';
  }
}

void FormulaPrinter::print(const warp::RegionFormula::Index &index) {
  if (index.base < 0) {
    stream << '*';
    return;
  }
  print(index.base);
  for (const warp::RegionFormula::Symbol &symbol : index.symbols) {
    stream << " + ";
    print(symbol.factor);
    stream << " * ";
    print(symbol.count);
  }
}

std::string FormulaPrinter::run() {
  for (const warp::RegionFormula::Access &access : formula.accesses) {
    stream << (access.reads ? "read" : "") << (access.writes ? "write" : "")
           << ' ' << leaves.getName(access.array) << '[';
    llvm::interleaveComma(access.indices, stream,
                          [&](const auto &index) { print(index); });
    stream << "]\n";
  }
  for (auto [leaf, isUnknown] : llvm::enumerate(formula.unknown))
    if (isUnknown)
      stream << "all of " << leaves.getName(leaf) << '\n';
  if (formula.isOpen)
    stream << "memory that no argument names\n";
  if (formula.prints)
    stream << "output\n";
  return text;
}

std::string warp::regionText(const Module &module) {
  ContextLock lock;
  return FormulaPrinter(module).run();
}

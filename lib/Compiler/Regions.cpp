//===- Regions.cpp - Access regions of a kernel's arrays ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Analysis/AccessRegions.h"
#include "Analysis/ArrayOrigins.h"
#include "Context.h"

#include "warp/Compile.h"

#include "WarpDialect/WarpDialect.h"

#include "mlir/Pass/PassManager.h"
#include "mlir/Transforms/Passes.h"

#include "llvm/ADT/DenseMap.h"
#include "llvm/Support/raw_ostream.h"

using namespace mlir;

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

namespace {
/// Operations of functions once all calls in them are inlined.
class InlinedSize {
public:
  int64_t of(func::FuncOp function) {
    auto [entry, isNew] = sizes.try_emplace(function, mostInlined);
    if (!isNew)
      return entry->second;
    int64_t size = 0;
    function.walk([&](Operation *op) {
      size += 1;
      if (auto call = dyn_cast<func::CallOp>(op))
        if (auto callee = SymbolTable::lookupNearestSymbolFrom<func::FuncOp>(
                op, call.getCalleeAttr()))
          size += of(callee);
      return size < mostInlined ? WalkResult::advance()
                                : WalkResult::interrupt();
    });
    return sizes[function] = size;
  }
  /// Kernels of more operations are analysed without inlining.
  static constexpr int64_t mostInlined = 20000;

private:
  llvm::DenseMap<Operation *, int64_t> sizes;
};
} // namespace

warp::RegionFormula warp::regionFormula(const Module &module) {
  ContextLock lock;
  ModuleOp given = *module.getImpl()->op;
  func::FuncOp kernel = kernelOf(given);
  if (!passesArrays(kernel) ||
      InlinedSize().of(kernel) >= InlinedSize::mostInlined)
    return findAccessRegions(kernel);
  // Indices are followed in the kernel alone. Nothing is simplified: this is
  // done for each kernel of a process that captures a graph.
  OwningOpRef<ModuleOp> copy = given.clone();
  PassManager pm(&compilerContext());
  pm.addPass(createInlinerPass({}, [](OpPassManager &) {}));
  pm.addPass(createSymbolDCEPass());
  pm.enableVerifier(false);
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
        leaves(warp::kernelOf(*module.getImpl()->op)),
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

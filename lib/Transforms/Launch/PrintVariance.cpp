//===- PrintVariance.cpp - Text of the divergence analysis ----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The answers of ThreadVariance about a kernel, a line per value, branch and
// loop, to read and to test.
//
//===----------------------------------------------------------------------===//

#include "Analysis/ThreadVariance.h"
#include "KernelFunction.h"

#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/AsmState.h"

#include "llvm/Support/raw_ostream.h"

namespace warp {
#define GEN_PASS_DEF_PRINTVARIANCE
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;

namespace {

/// Writes the facts about one kernel.
class VariancePrinter {
public:
  VariancePrinter(FunctionOpInterface kernel, raw_ostream &stream)
      : kernel(kernel), variance(kernel), names(kernel), stream(stream) {}

  void run();

private:
  void print(Region &region, unsigned depth);
  void print(Operation &op, unsigned depth);
  void print(Value value);
  void printNumber(Value value);

  FunctionOpInterface kernel;
  warp::ThreadVariance variance;
  AsmState names;
  raw_ostream &stream;
};

} // namespace

/// A sum, and bounds that are closer than those of the type.
void VariancePrinter::printNumber(Value value) {
  const warp::Form &form = variance.form(value);
  if (form.getSymbol() != warp::Symbol::opaque(value)) {
    stream << " = ";
    form.print(stream, names);
  }
  warp::Interval range = variance.range(value, value.getParentBlock());
  bool isFromZero = range.low >= 0, isBounded = range.high < INT32_MAX - 1;
  if (form.getConstant() || (!isFromZero && !isBounded))
    return;
  stream << " in [";
  if (range.low >= -INT32_MAX)
    stream << int64_t(range.low);
  stream << ", ";
  if (isBounded)
    stream << int64_t(range.high);
  stream << ']';
}

void VariancePrinter::print(Value value) {
  if (variance.isUniform(value, warp::Scope::Launch)) {
    stream << "uniform over the launch";
  } else if (variance.isUniform(value, warp::Scope::Lanes)) {
    stream << "uniform over lanes";
  } else if (std::optional<int64_t> step = variance.step(value)) {
    stream << "step " << *step;
  } else {
    stream << "varies";
  }
  if (warp::getIntegerBits(value.getType()) > 1)
    printNumber(value);
  stream << '\n';
}

void VariancePrinter::print(Operation &op, unsigned depth) {
  if (isa<scf::IfOp, scf::ForOp, scf::WhileOp>(op))
    stream.indent(depth) << op.getName() << ": "
                         << (variance.isDivergent(&op) ? "divergent"
                                                       : "in step")
                         << '\n';
  for (OpResult result : op.getResults()) {
    stream.indent(depth);
    result.printAsOperand(stream, names);
    stream << " = " << op.getName() << ": ";
    print(result);
  }
  for (Region &region : op.getRegions())
    print(region, depth + 2);
}

void VariancePrinter::print(Region &region, unsigned depth) {
  for (Block &block : region) {
    for (BlockArgument argument : block.getArguments()) {
      stream.indent(depth);
      argument.printAsOperand(stream, names);
      stream << ": ";
      print(argument);
    }
    for (Operation &op : block)
      print(op, depth);
  }
}

void VariancePrinter::run() {
  stream << "variance of @" << kernel.getName() << '\n';
  print(kernel.getFunctionBody(), 2);
}

namespace {

struct PrintVariance : warp::impl::PrintVarianceBase<PrintVariance> {
  void runOnOperation() override {
    FunctionOpInterface kernel = warp::findKernel(getOperation());
    if (!kernel)
      return signalPassFailure();
    VariancePrinter(kernel, llvm::outs()).run();
    markAllAnalysesPreserved();
  }
};

} // namespace

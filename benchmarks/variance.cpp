// A variance analysis over structured control flow: walks to a fixed point, as
// lib/Analysis and lib/Transforms/Tiles have them, against MLIR's sparse
// data-flow framework. One bit a value: depends on the thread. The input is
// thread IR in generic form:
//
//   python scripts/kernel_corpus.py corpus --adjoints
//   for f in corpus/*.mlir; do build/bin/warp-opt $f --warp-pipeline=to-thread
//   \
//     --mlir-print-op-generic > $f.thread; done
//   clang++ -O2 -fno-rtti -I/usr/lib/llvm-22/include benchmarks/variance.cpp \
//     -L/usr/lib/llvm-22/lib -lMLIR -lLLVM -o variance
//   ./variance corpus/*.thread

#include "mlir/Analysis/DataFlow/ConstantPropagationAnalysis.h"
#include "mlir/Analysis/DataFlow/DeadCodeAnalysis.h"
#include "mlir/Analysis/DataFlow/SparseAnalysis.h"
#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/Dialect/Math/IR/Math.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/Parser/Parser.h"

#include <chrono>

using namespace mlir;
using namespace mlir::dataflow;

namespace {

bool isThreadIndex(Operation *op) {
  return op->getName().getStringRef() == "warp.tid";
}

//===----------------------------------------------------------------------===//
// The framework
//===----------------------------------------------------------------------===//

struct Varies {
  bool value = false;

  bool operator==(const Varies &other) const { return value == other.value; }
  static Varies join(const Varies &a, const Varies &b) {
    return {a.value || b.value};
  }
  void print(raw_ostream &os) const { os << value; }
};

class Analysis : public SparseForwardDataFlowAnalysis<Lattice<Varies>> {
public:
  using SparseForwardDataFlowAnalysis::SparseForwardDataFlowAnalysis;
  using State = Lattice<Varies>;

  void setToEntryState(State *) override {}

  LogicalResult visitOperation(Operation *op, ArrayRef<const State *> operands,
                               ArrayRef<State *> results) override {
    bool varies = isThreadIndex(op);
    for (const State *operand : operands)
      varies |= operand->getValue().value;
    for (State *result : results)
      propagateIfChanged(result, result->join({varies}));
    return success();
  }

  /// Results of a branch depend on its condition, those of a loop on its end.
  /// The framework's version cannot be called from here: it is private.
  void
  visitRegionSuccessors(ProgramPoint *point, RegionBranchOpInterface branch,
                        RegionSuccessor successor,
                        ArrayRef<AbstractSparseLattice *> lattices) override {
    auto valueOf = [&](Value value) {
      return getLatticeElementFor(point, value)->getValue();
    };
    auto joinTo = [&](AbstractSparseLattice *target, Varies value) {
      propagateIfChanged(target, static_cast<State *>(target)->join(value));
    };
    bool hasCounter = !successor.isParent() && isa<scf::ForOp>(*branch);
    const auto *predecessors = getOrCreateFor<PredecessorState>(point, point);
    for (Operation *from : predecessors->getKnownPredecessors()) {
      OperandRange passed = from == branch
                                ? branch.getEntrySuccessorOperands(successor)
                                : cast<RegionBranchTerminatorOpInterface>(from)
                                      .getSuccessorOperands(successor);
      for (auto [value, target] :
           llvm::zip(passed, lattices.drop_front(hasCounter)))
        joinTo(target, valueOf(value));
    }
    Value decision;
    if (auto choice = dyn_cast<scf::IfOp>(*branch))
      decision = choice.getCondition();
    else if (auto loop = dyn_cast<scf::ForOp>(*branch))
      decision = loop.getUpperBound();
    if (decision)
      for (AbstractSparseLattice *target : lattices)
        joinTo(target, valueOf(decision));
  }
};

//===----------------------------------------------------------------------===//
// Walks
//===----------------------------------------------------------------------===//

class Walks {
public:
  explicit Walks(Operation *module) {
    while (changed) {
      changed = false;
      module->walk([&](Operation *op) { visit(op); });
    }
  }

private:
  bool has(Value value) const { return values.contains(value); }
  void mark(Value value) { changed |= values.insert(value).second; }

  void visit(Operation *op) {
    if (auto branch = dyn_cast<scf::IfOp>(op)) {
      for (auto [i, result] : llvm::enumerate(branch.getResults()))
        if (has(branch.getCondition()) ||
            has(branch.thenYield().getOperand(i)) ||
            has(branch.elseYield().getOperand(i)))
          mark(result);
    } else if (auto loop = dyn_cast<scf::ForOp>(op)) {
      bool differs = has(loop.getLowerBound()) || has(loop.getUpperBound()) ||
                     has(loop.getStep());
      if (differs)
        mark(loop.getInductionVar());
      for (auto [init, argument, next, result] :
           llvm::zip(loop.getInitArgs(), loop.getRegionIterArgs(),
                     loop.getYieldedValues(), loop.getResults()))
        if (differs || has(init) || has(next)) {
          mark(argument);
          mark(result);
        }
    } else if (auto loop = dyn_cast<scf::WhileOp>(op)) {
      visitWhile(loop);
    } else if (op->getNumRegions() == 0 &&
               !op->hasTrait<OpTrait::IsTerminator>() &&
               (isThreadIndex(op) ||
                llvm::any_of(op->getOperands(),
                             [&](Value v) { return has(v); }))) {
      llvm::for_each(op->getResults(), [&](Value v) { mark(v); });
    }
  }

  void visitWhile(scf::WhileOp loop) {
    scf::ConditionOp condition = loop.getConditionOp();
    for (auto [init, argument, next] :
         llvm::zip(loop.getInits(), loop.getBeforeArguments(),
                   loop.getYieldOp().getOperands()))
      if (has(init) || has(next))
        mark(argument);
    for (auto [value, argument, result] : llvm::zip(
             condition.getArgs(), loop.getAfterArguments(), loop.getResults()))
      if (has(condition.getCondition()) || has(value)) {
        mark(argument);
        mark(result);
      }
  }

  llvm::DenseSet<Value> values;
  bool changed = true;
};

template <typename Run> double seconds(Run run) {
  double best = 1e9;
  for (int i = 0; i < 5; ++i) {
    auto start = std::chrono::steady_clock::now();
    run();
    std::chrono::duration<double> time =
        std::chrono::steady_clock::now() - start;
    best = std::min(best, time.count());
  }
  return best;
}

} // namespace

int main(int count, char **files) {
  DialectRegistry registry;
  registry.insert<arith::ArithDialect, func::FuncDialect, scf::SCFDialect,
                  math::MathDialect, LLVM::LLVMDialect>();
  MLIRContext context(registry, MLIRContext::Threading::DISABLED);
  context.allowUnregisteredDialects();
  context.loadAllAvailableDialects();
  double walks = 0, framework = 0;
  int64_t operations = 0;
  for (int i = 1; i < count; ++i) {
    auto module = parseSourceFile<ModuleOp>(files[i], &context);
    if (!module)
      return 1;
    module->walk([&](Operation *) { ++operations; });
    walks += seconds([&] { Walks(module->getOperation()); });
    framework += seconds([&] {
      DataFlowSolver solver;
      // Without these two no block counts as executed.
      solver.load<DeadCodeAnalysis>();
      solver.load<SparseConstantPropagation>();
      solver.load<Analysis>();
      (void)solver.initializeAndRun(*module);
    });
  }
  llvm::outs() << count - 1 << " kernels, " << operations
               << " operations: walks " << walks * 1e3 << " ms, framework "
               << framework * 1e3 << " ms\n";
}

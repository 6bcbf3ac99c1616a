// Counted loops unrolled fully: copies that are folded as they are made, as
// lib/Transforms/Launch/UnrollLoop.cpp makes them, against MLIR's
// loopUnrollFull with greedy folding behind it.
//
//   clang++ -O2 -fno-rtti -I/usr/lib/llvm-22/include benchmarks/unrolling.cpp \
//     -L/usr/lib/llvm-22/lib -lMLIR -lLLVM -o unrolling && ./unrolling

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/Dialect/SCF/Utils/Utils.h"
#include "mlir/IR/IRMapping.h"
#include "mlir/IR/Matchers.h"
#include "mlir/Parser/Parser.h"
#include "mlir/Transforms/GreedyPatternRewriteDriver.h"

#include <chrono>
#include <string>

using namespace mlir;

namespace {

int64_t constantOf(Value value) {
  APInt number;
  matchPattern(value, m_ConstantInt(&number));
  return number.getSExtValue();
}

void unrollFolded(scf::ForOp loop) {
  OpBuilder b(loop);
  Type type = loop.getInductionVar().getType();
  int64_t trips = loop.getStaticTripCount()->getZExtValue();
  int64_t counter = constantOf(loop.getLowerBound());
  int64_t step = constantOf(loop.getStep());
  SmallVector<Value> carried(loop.getInitArgs());
  for (int64_t trip = 0; trip < trips; ++trip, counter += step) {
    IRMapping map;
    map.map(loop.getRegionIterArgs(), carried);
    Value number = arith::ConstantOp::create(b, loop.getLoc(),
                                             b.getIntegerAttr(type, counter));
    map.map(loop.getInductionVar(), number);
    for (Operation &op : loop.getBody()->without_terminator()) {
      Operation *copy = b.clone(op, map);
      SmallVector<Value> folded;
      if (failed(b.tryFold(copy, folded)) || folded.empty())
        continue;
      map.map(op.getResults(), folded);
      copy->erase();
    }
    for (auto [value, next] : llvm::zip_equal(carried, loop.getYieldedValues()))
      value = map.lookupOrDefault(next);
  }
  loop.replaceAllUsesWith(carried);
  loop.erase();
}

void unrollByUtility(scf::ForOp loop) {
  Operation *function = loop->getParentOp();
  (void)loopUnrollFull(loop);
  (void)applyPatternsGreedily(function, RewritePatternSet(loop.getContext()));
}

/// A loop over eight loads whose addresses follow the counter.
std::string makeLoop(int trips) {
  std::string body, sum = "%s";
  for (int i = 0; i < 8; ++i) {
    std::string n = std::to_string(i);
    body += "%m" + n + " = arith.muli %i, %k : i32\n%a" + n +
            " = arith.addi %m" + n + ", %n : i32\n%x" + n +
            " = \"test.load\"(%m" + n + ", %a" + n +
            ") : (i32, i32) -> f32\n%s" + n + " = arith.addf " + sum + ", %x" +
            n + " : f32\n";
    sum = "%s" + n;
  }
  return "func.func @f(%n: i32) -> f32 {\n%z = arith.constant 0 : i32\n"
         "%o = arith.constant 1 : i32\n%k = arith.constant 3 : i32\n"
         "%e = arith.constant " +
         std::to_string(trips) +
         " : i32\n%f = arith.constant 0.0 : f32\n%r = scf.for %i = %z to %e "
         "step %o iter_args(%s = %f) -> (f32) : i32 {\n" +
         body + "scf.yield " + sum + " : f32\n}\nreturn %r : f32\n}";
}

double seconds(MLIRContext &context, const std::string &text,
               void (*run)(scf::ForOp)) {
  double best = 1e9;
  for (int i = 0; i < 10; ++i) {
    auto module = parseSourceString<ModuleOp>(text, &context);
    scf::ForOp loop;
    module->walk([&](scf::ForOp found) { loop = found; });
    auto start = std::chrono::steady_clock::now();
    run(loop);
    std::chrono::duration<double> time =
        std::chrono::steady_clock::now() - start;
    best = std::min(best, time.count());
  }
  return best;
}

} // namespace

int main() {
  DialectRegistry registry;
  registry.insert<arith::ArithDialect, func::FuncDialect, scf::SCFDialect>();
  MLIRContext context(registry, MLIRContext::Threading::DISABLED);
  context.allowUnregisteredDialects();
  context.loadAllAvailableDialects();
  for (int trips : {8, 32, 128}) {
    std::string text = makeLoop(trips);
    llvm::outs() << trips << " trips of 32 operations: folded copies "
                 << seconds(context, text, unrollFolded) * 1e6
                 << " us, utility and folding "
                 << seconds(context, text, unrollByUtility) * 1e6 << " us\n";
  }
}

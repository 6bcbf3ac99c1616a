//===- UnrollLoops.cpp - Partial unrolling of GPU loops -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A warp of a GPU runs its instructions in order, and each takes a few cycles
// until its result is there, a load or a square root dozens. A small loop
// without copies of its body leaves the card waiting unless many warps share
// it. Two kinds of innermost loops get copies; what they carry is computed in
// the same order as before.
//
// A counted loop that only loads and computes is marked for LLVM, which copies
// the body and adds a loop for the iterations that are left. If the number of
// iterations is known, there are as many copies as divide it, or one for each:
// LLVM itself would make three of the 27 products of a row, which waits for
// memory nine times.
//
// A loop with a condition, whose iterations compute and do nothing else, runs
// several of them ahead and then asks for all conditions at once:
//
//   while (c(s)) s = f(s)
//   ==>
//   while (c(s) & c(f(s)) & c(f(f(s)))) s = f(f(f(s)))
//   while (c(s)) s = f(s)
//
// The second loop finds the exit. It runs the last few iterations again, so
// this is not for loops inside of loops. A part of the condition that compares
// a counter with a bound is asked once:
//
//   k < n & k + 1 < n & k + 2 < n   ==>   k < n - 2
//
//===----------------------------------------------------------------------===//

#include "Choices.h"
#include "KernelFunction.h"
#include "NestRuns.h"
#include "UnrollLoop.h"

#include "WarpDialect/CallAttributes.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/Dialect/Math/IR/Math.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/IRMapping.h"
#include "mlir/IR/Matchers.h"
#include "mlir/Interfaces/LoopLikeInterface.h"
#include "llvm/Support/MathExtras.h"

namespace warp {
#define GEN_PASS_DEF_UNROLLLOOPS
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;

/// Copies of a body.
constexpr int64_t copies = 4;
/// Instructions of a body that is worth copies.
constexpr int64_t mostInstructions = 40;
/// Instructions and loaded words of all copies, where the trips are known.
constexpr int64_t mostUnrolled = 256, mostInFlight = 64;
/// Instructions that a call of a function counts, or a division in f64.
constexpr int64_t manyInstructions = 24;

/// Rough instructions of an operation; 0 if it is none.
static int64_t countInstructions(Operation *op) {
  if (op->hasTrait<OpTrait::ConstantLike>() ||
      op->hasTrait<OpTrait::IsTerminator>())
    return 0;
  if (isa<warp::LoadComponentsOp>(op))
    return op->getNumResults();
  if (isa<math::SqrtOp, math::RsqrtOp, arith::DivFOp>(op))
    return op->getResult(0).getType().isF64() ? manyInstructions : 4;
  if (isa<math::AbsFOp, math::FmaOp, math::FloorOp, math::CeilOp,
          math::RoundEvenOp, math::TruncOp, math::CopySignOp>(op))
    return 1;
  if (isa<math::MathDialect>(op->getDialect()) ||
      isa<arith::DivSIOp, arith::DivUIOp, arith::RemSIOp, arith::RemUIOp,
          arith::RemFOp>(op))
    return manyInstructions;
  return 1;
}

/// True if a block only loads, if it may, and computes; adds up its
/// instructions.
static bool isSimple(Block &block, bool mayLoad, int64_t &instructions) {
  for (Operation &op : block) {
    bool isLoad = isa<warp::LoadComponentsOp>(op);
    if (op.getNumRegions() != 0 || (isLoad && !mayLoad) ||
        (!isLoad && !op.hasTrait<OpTrait::IsTerminator>() && !isPure(&op)))
      return false;
    instructions += countInstructions(&op);
  }
  return instructions <= mostInstructions;
}

//===----------------------------------------------------------------------===//
// Counted loops
//===----------------------------------------------------------------------===//

/// Copies of a body that runs `trips` times, whose loads are in flight
/// together: all of them, or as many as divide the trips; 0 if few do.
static int64_t chooseCopies(int64_t trips, int64_t instructions,
                            int64_t loads) {
  int64_t most = std::min(mostUnrolled / std::max<int64_t>(instructions, 1),
                          mostInFlight / loads);
  if (trips <= most)
    return trips;
  for (int64_t number = most; number >= copies; --number)
    if (trips % number == 0)
      return number;
  return 0;
}

/// Copies for LLVM to make of the body; 0 if it decides.
static int64_t countCopies(scf::ForOp loop) {
  int64_t instructions = 0;
  if (!isSimple(*loop.getBody(), /*mayLoad=*/true, instructions))
    return 0;
  APInt first, last, step;
  if (!matchPattern(loop.getLowerBound(), m_ConstantInt(&first)) ||
      !matchPattern(loop.getUpperBound(), m_ConstantInt(&last)) ||
      !matchPattern(loop.getStep(), m_ConstantInt(&step)))
    return copies;
  int64_t loads = 0;
  for (auto load : loop.getBody()->getOps<warp::LoadComponentsOp>())
    loads += load.getNumResults();
  // LLVM knows what to do with iterations that do not wait for memory.
  int64_t range = last.getSExtValue() - first.getSExtValue();
  if (loads == 0 || range <= 0 || loop->hasAttr("loop_annotation"))
    return 0;
  return chooseCopies(llvm::divideCeil(range, step.getSExtValue()),
                      instructions, loads);
}

//===----------------------------------------------------------------------===//
// Loops with a condition
//===----------------------------------------------------------------------===//

namespace {

/// The loop of several iterations that goes in front of a loop.
class Ahead {
public:
  explicit Ahead(scf::WhileOp loop) : loop(loop), b(loop) {}

  bool qualifies();
  void build();

private:
  void collectTests(Value condition);
  bool isBound(Value test);
  Value buildBound(arith::CmpIOp test);
  SmallVector<Value> clone(Block &from, ValueRange arguments, IRMapping &map);

  scf::WhileOp loop;
  OpBuilder b;
  /// The condition is that all of these hold. The tests of `bounds` compare a
  /// counter that grows by 1 with an invariant.
  SmallVector<Value> tests;
  SmallVector<arith::CmpIOp> bounds;
};

} // namespace

/// Takes a conjunction apart.
void Ahead::collectTests(Value condition) {
  auto both = condition.getDefiningOp<arith::AndIOp>();
  if (both && both->getBlock() == loop.getBeforeBody()) {
    collectTests(both.getLhs());
    collectTests(both.getRhs());
  } else if (isBound(condition)) {
    bounds.push_back(condition.getDefiningOp<arith::CmpIOp>());
  } else {
    tests.push_back(condition);
  }
}

bool Ahead::isBound(Value test) {
  auto compare = test.getDefiningOp<arith::CmpIOp>();
  if (!compare || compare.getPredicate() != arith::CmpIPredicate::slt ||
      !loop.isDefinedOutsideOfLoop(compare.getRhs()))
    return false;
  auto counter = dyn_cast<BlockArgument>(compare.getLhs());
  if (!counter || counter.getOwner() != loop.getBeforeBody())
    return false;
  // The body sees it as the argument that the condition passes on.
  auto next = loop.getYieldOp()
                  .getOperand(counter.getArgNumber())
                  .getDefiningOp<arith::AddIOp>();
  auto inBody = next ? dyn_cast<BlockArgument>(next.getLhs()) : nullptr;
  return inBody && inBody.getOwner() == loop.getAfterBody() &&
         matchPattern(next.getRhs(), m_One()) &&
         loop.getConditionOp().getArgs()[inBody.getArgNumber()] == counter;
}

bool Ahead::qualifies() {
  int64_t instructions = 0;
  if (loop->getParentOfType<LoopLikeOpInterface>() ||
      !isSimple(*loop.getBeforeBody(), /*mayLoad=*/false, instructions) ||
      !isSimple(*loop.getAfterBody(), /*mayLoad=*/false, instructions))
    return false;
  collectTests(loop.getConditionOp().getCondition());
  return true;
}

/// Copies the operations of a block; returns what its terminator passes on.
SmallVector<Value> Ahead::clone(Block &from, ValueRange arguments,
                                IRMapping &map) {
  map.map(from.getArguments(), arguments);
  for (Operation &op : from.without_terminator())
    b.clone(op, map);
  SmallVector<Value> passed;
  for (Value value : from.getTerminator()->getOperands())
    passed.push_back(map.lookupOrDefault(value));
  return passed;
}

/// The bound that the counter of the first of the iterations has to be below
/// for all of them to be below theirs; the least integer if there is none.
Value Ahead::buildBound(arith::CmpIOp test) {
  Location loc = loop.getLoc();
  Value bound = test.getRhs();
  Type type = bound.getType();
  unsigned width = type.getIntOrFloatBitWidth();
  auto constant = [&](const APInt &value) -> Value {
    return arith::ConstantOp::create(b, loc, b.getIntegerAttr(type, value));
  };
  Value least = constant(APInt::getSignedMinValue(width) + (copies - 1));
  Value clamped = arith::MaxSIOp::create(b, loc, bound, least);
  return arith::SubIOp::create(b, loc, clamped,
                               constant(APInt(width, copies - 1)));
}

void Ahead::build() {
  Location loc = loop.getLoc();
  SmallVector<Value> limits;
  for (arith::CmpIOp bound : bounds)
    limits.push_back(buildBound(bound));
  SmallVector<Type> types(loop.getInits().getTypes());
  SmallVector<Location> locs(types.size(), loc);
  SmallVector<Type> twice(types);
  twice.append(types);
  auto ahead = scf::WhileOp::create(b, loc, twice, loop.getInits());
  Block *before = b.createBlock(&ahead.getBefore(), {}, types, locs);
  SmallVector<Value> state(before->getArguments());
  Value all;
  auto require = [&](Value holds) {
    all = all ? arith::AndIOp::create(b, loc, all, holds).getResult() : holds;
  };
  for (auto [bound, limit] : llvm::zip_equal(bounds, limits)) {
    unsigned i = cast<BlockArgument>(bound.getLhs()).getArgNumber();
    require(arith::CmpIOp::create(b, loc, arith::CmpIPredicate::slt, state[i],
                                  limit));
  }
  for (int64_t copy = 0; copy < copies; ++copy) {
    IRMapping map;
    SmallVector<Value> passed = clone(*loop.getBeforeBody(), state, map);
    for (Value test : tests)
      require(map.lookupOrDefault(test));
    state = clone(*loop.getAfterBody(), ArrayRef(passed).drop_front(), map);
  }
  SmallVector<Value> forwarded(before->getArguments());
  llvm::append_range(forwarded, state);
  if (!all)
    all = arith::ConstantOp::create(b, loc, b.getBoolAttr(true));
  scf::ConditionOp::create(b, loc, all, forwarded);
  locs.append(types.size(), loc);
  Block *after = b.createBlock(&ahead.getAfter(), {}, twice, locs);
  scf::YieldOp::create(b, loc, after->getArguments().drop_front(types.size()));
  loop.getInitsMutable().assign(ahead.getResults().take_front(types.size()));
}

static void noteCopies(Operation *entry, Operation *loop, int64_t copies) {
  warp::noteChoice(entry, "loop", Twine(copies) + " iterations at a time",
                   "a short body leaves the card waiting", loop);
}

namespace {

struct UnrollLoops : warp::impl::UnrollLoopsBase<UnrollLoops> {
  void runOnOperation() override {
    FunctionOpInterface entry = warp::findEntry(getOperation());
    if (!entry)
      return signalPassFailure();
    if (!warp::getTarget(entry).isSimt() ||
        warp::getVariant(entry).getDebug() ||
        entry->hasAttr(warp::attr::keepsCalls))
      return;
    warp::nestRuns(entry);
    SmallVector<scf::WhileOp> conditional;
    entry->walk([&](Operation *op) {
      if (auto loop = dyn_cast<scf::ForOp>(op)) {
        if (int64_t number = countCopies(loop); number > 1) {
          warp::setCopies(loop, number);
          noteCopies(entry, loop, number);
        }
      } else if (auto loop = dyn_cast<scf::WhileOp>(op)) {
        conditional.push_back(loop);
      }
    });
    for (scf::WhileOp loop : conditional)
      if (Ahead ahead(loop); ahead.qualifies()) {
        noteCopies(entry, loop, copies);
        ahead.build();
      }
  }
};

} // namespace

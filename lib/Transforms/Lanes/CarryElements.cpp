//===- CarryElements.cpp - Scalar replacement in recurrences --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// An element that one iteration stores and the next one loads is a value that
// the loop carries; the first iteration's is loaded before the loop:
//
//                                          c = q[e, 0]
//     for t in range(n):                   for t in range(n):
//       q[e, t + 1] = f(q[e, t])     =>      c = f(c);  q[e, t + 1] = c
//
// A load of the same iteration behind the store takes the stored value.
//
// A thread waits for no store of its own any more, and the array is only
// written in the loop, so that lanes can store several elements of their rows
// at once (RowRuns.cpp).
//
//===----------------------------------------------------------------------===//

#include "CarryElements.h"

#include "Analysis/ArrayOrigins.h"
#include "Analysis/Forms.h"
#include "KernelFunction.h"
#include "Variant.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/IRMapping.h"
#include "mlir/IR/PatternMatch.h"
#include "mlir/Interfaces/SideEffectInterfaces.h"

using namespace mlir;

namespace {
/// The store of an iteration, and the load of the next one or, behind the
/// store, of the same.
struct Recurrence {
  scf::ForOp loop;
  warp::StoreComponentsOp store;
  warp::LoadComponentsOp load;

  bool isInOneIteration() { return store->isBeforeInBlock(load); }
};

class Finder {
public:
  explicit Finder(FunctionOpInterface kernel)
      : kernel(kernel), origins(kernel, /*disjoint=*/true) {}

  std::optional<Recurrence> find();

private:
  bool isOnlyWrite(Recurrence found) const;
  bool isRead(Recurrence found);
  bool canRunBefore(Value value, scf::ForOp loop) const;

  FunctionOpInterface kernel;
  warp::ArrayOrigins origins;
  warp::Forms forms;
};
} // namespace

/// True if nothing else in the loop writes to the array.
bool Finder::isOnlyWrite(Recurrence found) const {
  return !found.loop
              .walk([&](Operation *op) {
                auto access = dyn_cast<warp::AccessOp>(op);
                bool isOther =
                    op == found.store || op->getNumRegions() != 0 ||
                    isMemoryEffectFree(op) ||
                    (access && (!access.mayWrite() ||
                                !origins.mayAlias(access.getArray(),
                                                  found.store.getArray())));
                return isOther ? WalkResult::advance()
                               : WalkResult::interrupt();
              })
              .wasInterrupted();
}

/// True if each iteration loads what the one before, or this one, has stored.
bool Finder::isRead(Recurrence found) {
  ValueRange to = found.store.getIndices(), from = found.load.getIndices();
  if (to.empty() || to.size() != from.size())
    return false;
  for (auto [stored, loaded] :
       llvm::zip_equal(to.drop_back(), from.drop_back())) {
    warp::Form form = forms.of(stored);
    if (!form.equals(forms.of(loaded)) || !form.isDefinedOutside(found.loop))
      return false;
  }
  warp::Symbol trip = warp::Symbol::trip(found.loop);
  warp::Form stored = forms.of(to.back()), loaded = forms.of(from.back());
  std::optional<warp::Form> pace = stored.coefficientOf(trip);
  std::optional<warp::Form> ahead = stored - loaded;
  std::optional<int64_t> step = pace ? pace->getConstant() : std::nullopt;
  bool isHere = found.isInOneIteration();
  return step && *step != 0 && ahead &&
         ahead->getConstant() == (isHere ? 0 : *step) &&
         stored.without(trip).isDefinedOutside(found.loop);
}

/// True if a value of the loop's body can be computed before the loop.
bool Finder::canRunBefore(Value value, scf::ForOp loop) const {
  if (loop.isDefinedOutsideOfLoop(value) || value == loop.getInductionVar())
    return true;
  Operation *op = value.getDefiningOp();
  return op && op->getBlock() == loop.getBody() && isPure(op) &&
         op->getNumRegions() == 0 &&
         llvm::all_of(op->getOperands(),
                      [&](Value one) { return canRunBefore(one, loop); });
}

std::optional<Recurrence> Finder::find() {
  std::optional<Recurrence> result;
  kernel->walk([&](scf::ForOp loop) {
    for (auto store : loop.getBody()->getOps<warp::StoreComponentsOp>())
      for (auto load : loop.getBody()->getOps<warp::LoadComponentsOp>()) {
        Recurrence found{loop, store, load};
        if (load.getArray() != store.getArray() ||
            !loop.isDefinedOutsideOfLoop(load.getArray()) || !isRead(found) ||
            !isOnlyWrite(found))
          continue;
        bool isBefore = llvm::all_of(load.getIndices(), [&](Value index) {
          return canRunBefore(index, loop);
        });
        if (!found.isInOneIteration() && !isBefore)
          continue;
        result = found;
        return WalkResult::interrupt();
      }
    return WalkResult::advance();
  });
  return result;
}

/// The load of the first iteration, before the loop.
static warp::LoadComponentsOp loadFirst(OpBuilder &b, Recurrence found) {
  IRMapping map;
  map.map(found.loop.getInductionVar(), found.loop.getLowerBound());
  auto copy = [&](auto &copy, Value value) -> void {
    if (map.contains(value) || found.loop.isDefinedOutsideOfLoop(value))
      return;
    Operation *op = value.getDefiningOp();
    for (Value operand : op->getOperands())
      copy(copy, operand);
    b.clone(*op, map);
  };
  for (Value index : found.load.getIndices())
    copy(copy, index);
  return cast<warp::LoadComponentsOp>(b.clone(*found.load, map));
}

/// The values that the first iteration loads; zeros if there is none.
static SmallVector<Value> valuesBefore(RewriterBase &b, Recurrence found) {
  scf::ForOp loop = found.loop;
  Location loc = found.load.getLoc();
  std::optional<APInt> trips = loop.getStaticTripCount();
  if (trips && !trips->isZero())
    return loadFirst(b, found).getComponents();
  auto kind = loop.getUnsignedCmp() ? arith::CmpIPredicate::ult
                                    : arith::CmpIPredicate::slt;
  Value runs = arith::CmpIOp::create(b, loc, kind, loop.getLowerBound(),
                                     loop.getUpperBound());
  auto branch = scf::IfOp::create(b, loc, found.load->getResultTypes(), runs,
                                  /*withElseRegion=*/true);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(branch.thenBlock());
  scf::YieldOp::create(b, loc, loadFirst(b, found).getComponents());
  b.setInsertionPointToStart(branch.elseBlock());
  SmallVector<Value> none;
  for (Type type : found.load->getResultTypes())
    none.push_back(arith::ConstantOp::create(b, loc, b.getZeroAttr(type)));
  scf::YieldOp::create(b, loc, none);
  return branch.getResults();
}

static void carry(RewriterBase &b, Recurrence found) {
  if (found.isInOneIteration())
    return b.replaceOp(found.load, found.store.getComponents());
  b.setInsertionPoint(found.loop);
  SmallVector<Value> inits = valuesBefore(b, found);
  SmallVector<Value> stored(found.store.getComponents());
  DictionaryAttr attributes = found.loop->getDiscardableAttrDictionary();
  auto made = cast<scf::ForOp>(*found.loop.replaceWithAdditionalYields(
      b, inits, /*replaceInitOperandUsesInLoop=*/false,
      [&](OpBuilder &, Location, ArrayRef<BlockArgument>) { return stored; }));
  made->setDiscardableAttrs(attributes);
  b.replaceOp(found.load,
              ValueRange(made.getRegionIterArgs()).take_back(inits.size()));
}

void warp::carryElements(FunctionOpInterface kernel) {
  if (!warp::getVariant(kernel).getDisjoint())
    return;
  IRRewriter b(kernel->getContext());
  while (std::optional<Recurrence> found = Finder(kernel).find())
    carry(b, *found);
}

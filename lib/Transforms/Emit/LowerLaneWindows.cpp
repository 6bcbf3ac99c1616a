//===- LowerLaneWindows.cpp - Sums over sliding windows in registers ------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Adjoints of windows (`y[i] = f(x[i], ..., x[i + n])`) add to elements that
// overlap from one update of the lanes to the next:
//
//   x.grad[i + 2] += c;  x.grad[i + 1] += b;  x.grad[i] += a
//
// A processor cannot take what it loads from two stores before they are in the
// cache, so each update waits for the one before, some twenty cycles. Updates
// of one array with nothing in between that may access it are therefore added
// in registers, by a tree that shifts the lanes of the later half, and each
// element is updated once:
//
//   if lanes of all updates are at neighbours, shifted by known numbers
//     s, t = a + (b << 1) + (c << 2)     lanes, and those shifted out
//     x.grad[i ...] += s;  x.grad[i + lanes ...] += t
//   else
//     one update after the other
//
// Numbers of the shifts are read off the indices, and compared with what these
// are: at a periodic border, say, they are others. Sums are made in another
// order than the program's, which a deterministic launch keeps.
//
//===----------------------------------------------------------------------===//

#include "Analysis/ArrayOrigins.h"
#include "KernelFunction.h"
#include "LaneAccess.h"
#include "Lanes/Neighbours.h"
#include "Lanes/Spread.h"
#include "Updates/Atomics.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/Matchers.h"
#include "mlir/Interfaces/SideEffectInterfaces.h"

using namespace mlir;
using namespace warp;

/// Fewer updates are not worth the comparisons.
constexpr size_t fewestUpdates = 3;

//===----------------------------------------------------------------------===//
// Finding updates of one window
//===----------------------------------------------------------------------===//

/// A value without the constants that are added to it, and their sum.
static std::pair<mlir::Value, int64_t> withoutConstants(mlir::Value value) {
  int64_t sum = 0;
  while (auto add = value.getDefiningOp<arith::AddIOp>()) {
    DenseIntElementsAttr lanes;
    APInt number;
    if (matchPattern(add.getRhs(), m_ConstantInt(&number)))
      sum += number.getSExtValue();
    else if (matchPattern(add.getRhs(), m_Constant(&lanes)) && lanes.isSplat())
      sum += lanes.getSplatValue<APInt>().getSExtValue();
    else
      break;
    value = add.getLhs();
  }
  return {value, sum};
}

/// By how much the lanes of `b` are beyond those of `a`, as it looks: both are
/// computed alike, from numbers that differ.
static std::optional<int64_t> shiftBetween(mlir::Value a, mlir::Value b,
                                           int depth = 6) {
  auto [first, more] = withoutConstants(a);
  auto [second, most] = withoutConstants(b);
  if (first == second)
    return most - more;
  APInt one, other;
  if (matchPattern(first, m_ConstantInt(&one)) &&
      matchPattern(second, m_ConstantInt(&other)))
    return (other - one).getSExtValue() + most - more;
  Operation *left = first.getDefiningOp(), *right = second.getDefiningOp();
  if (depth == 0 || !left || !right || left->getName() != right->getName() ||
      left->getNumOperands() != right->getNumOperands() ||
      left->getNumRegions() > 0 || !isMemoryEffectFree(left))
    return std::nullopt;
  auto partOf = [&](unsigned i) {
    return shiftBetween(left->getOperand(i), right->getOperand(i), depth - 1);
  };
  int64_t shift = 0;
  // A remainder: the quotients are the same but at a border.
  auto difference = dyn_cast<arith::SubIOp>(left);
  bool isSum = isa<arith::AddIOp>(left), isProduct = isa<arith::MulIOp>(left);
  bool isRemainder =
      difference && difference.getRhs().getDefiningOp<arith::MulIOp>();
  for (unsigned i = 0, n = isRemainder ? 1 : left->getNumOperands(); i < n;
       ++i) {
    std::optional<int64_t> part = partOf(i);
    bool mayShift = !isProduct && (!difference || i == 0);
    if (!part || (*part != 0 && !mayShift) ||
        (!isSum && shift != 0 && *part != 0 && *part != shift))
      return std::nullopt;
    shift = isSum ? shift + *part : shift == 0 ? *part : shift;
  }
  return shift + most - more;
}

namespace {
/// Collects updates of windows, block by block.
class WindowFinder {
public:
  using Windows = llvm::DenseMap<Operation *, LaneWindow>;

  WindowFinder(LLVM::LLVMFuncOp entry, Windows &windows)
      : origins(entry, getVariant(entry).getDisjoint()), windows(windows) {}

  void visit(Block &block) {
    for (Operation &op : block)
      visit(op);
    closeIf([](LaneWindow &) { return true; });
  }

private:
  void visit(Operation &op);
  bool join(UpdateLanesOp update);
  void closeIf(function_ref<bool(LaneWindow &)> isMet);

  ArrayOrigins origins;
  Windows &windows;
  SmallVector<LaneWindow> open;
};
} // namespace

static int64_t countLanes(UpdateLanesOp update) {
  return cast<VectorType>(update.getMask().getType()).getNumElements();
}

static bool mayBeOfWindow(UpdateLanesOp update) {
  mlir::Type element =
      cast<warp::ArrayType>(update.getArray().getType()).getElementType();
  mlir::Type word = getSignless(element);
  auto last = dyn_cast<VectorType>(update.getIndices().back().getType());
  return update->hasAttr(attr::neighbours) &&
         update.getKind() == AtomicKind::add &&
         (word.isF32() || word.isF64() || word.isInteger(32) ||
          word.isInteger(64)) &&
         last && last.getElementType().isInteger() &&
         llvm::isPowerOf2_64(countLanes(update)) && countLanes(update) >= 4 &&
         llvm::none_of(update.getIndices().drop_back(), [](mlir::Value index) {
           return isa<VectorType>(index.getType());
         });
}

/// Adds an update to the open window of its array.
bool WindowFinder::join(UpdateLanesOp update) {
  for (LaneWindow &window : open) {
    UpdateLanesOp first = window.front().update;
    if (first.getArray() != update.getArray() ||
        first.getMask() != update.getMask() ||
        first.getIndices().drop_back() != update.getIndices().drop_back())
      continue;
    std::optional<int64_t> shift =
        shiftBetween(first.getIndices().back(), update.getIndices().back());
    if (!shift)
      return false;
    window.push_back({update, *shift});
    return true;
  }
  return false;
}

void WindowFinder::visit(Operation &op) {
  if (op.getNumRegions() > 0)
    return closeIf([](LaneWindow &) { return true; });
  // Memory of a thread is no array's.
  if (isMemoryEffectFree(&op) ||
      isa<ScratchOp, ScratchLoadOp, ScratchStoreOp>(op))
    return;
  auto update = dyn_cast<UpdateLanesOp>(op);
  bool isOfWindow = update && mayBeOfWindow(update);
  if (isOfWindow && join(update))
    return closeIf([&](LaneWindow &window) {
      return window.back().update != update &&
             origins.mayAlias(window.front().update.getArray(),
                              update.getArray());
    });
  auto access = dyn_cast<AccessOp>(op);
  closeIf([&](LaneWindow &window) {
    return !access || origins.mayAlias(window.front().update.getArray(),
                                       access.getArray());
  });
  if (isOfWindow)
    open.push_back({{update, 0}});
}

/// Closes open windows, and keeps those of overlapping updates.
void WindowFinder::closeIf(function_ref<bool(LaneWindow &)> isMet) {
  llvm::erase_if(open, [&](LaneWindow &window) {
    if (!isMet(window))
      return false;
    Operation *last = window.back().update;
    LaneWindow sorted = window;
    llvm::sort(sorted, [](const WindowUpdate &a, const WindowUpdate &b) {
      return a.shift < b.shift;
    });
    int64_t lanes = countLanes(window.front().update), least = sorted[0].shift;
    bool overlap = window.size() >= fewestUpdates;
    for (size_t i = 1; i < sorted.size(); ++i)
      overlap &= sorted[i].shift - sorted[i - 1].shift <= lanes / 4;
    if (overlap) {
      for (WindowUpdate &one : window) {
        one.shift -= least;
        windows[one.update];
      }
      windows[last] = window;
    }
    return true;
  });
}

void ArrayLowering::findWindows() {
  if (!exclusive || debug || getVariant(entry).getDeterministic())
    return;
  WindowFinder finder(entry, windows);
  entry.walk([&](Block *block) { finder.visit(*block); });
}

//===----------------------------------------------------------------------===//
// Lowering
//===----------------------------------------------------------------------===//

namespace {
/// Sums of lanes, and of what was shifted out of them.
struct ShiftedSum {
  mlir::Value low, high;
};

/// Adds vectors of lanes, the one at place k shifted by k lanes.
class ShiftTree {
public:
  ShiftTree(OpBuilder &b, Location loc, VectorType type, mlir::Type scalar)
      : b(b), loc(loc), lanes(type.getNumElements()), scalar(scalar),
        zero(arith::ConstantOp::create(b, loc, b.getZeroAttr(type))) {}

  mlir::Value add(mlir::Value x, mlir::Value y) {
    if (!x || !y)
      return x ? x : y;
    return combine(b, loc, AtomicKind::add, x, y, scalar);
  }

  /// `terms` are a power of two, null where there are none.
  ShiftedSum sum(ArrayRef<mlir::Value> terms) {
    if (terms.size() == 1)
      return {terms[0], nullptr};
    int64_t half = terms.size() / 2;
    ShiftedSum x = sum(terms.take_front(half)), y = sum(terms.drop_front(half));
    if (!y.low)
      return x;
    return {add(x.low, join(zero, y.low, lanes - half)),
            add(x.high, join(y.low, y.high ? y.high : zero, lanes - half))};
  }

private:
  /// Lanes from number `first` on of those of two vectors.
  mlir::Value join(mlir::Value x, mlir::Value y, int64_t first) {
    SmallVector<int32_t> numbers;
    for (int64_t lane = 0; lane < lanes; ++lane)
      numbers.push_back(first + lane);
    return LLVM::ShuffleVectorOp::create(b, loc, x, y, numbers);
  }

  OpBuilder &b;
  Location loc;
  int64_t lanes;
  mlir::Type scalar;
  mlir::Value zero;
};
} // namespace

/// The first `count` of the lanes.
static mlir::Value prefixMask(OpBuilder &b, Location loc, int64_t lanes,
                              int64_t count) {
  SmallVector<bool> taken;
  for (int64_t lane = 0; lane < lanes; ++lane)
    taken.push_back(lane < count);
  auto type = VectorType::get(lanes, b.getI1Type());
  return arith::ConstantOp::create(b, loc, DenseElementsAttr::get(type, taken));
}

/// True if all lanes live, and those of each update are at neighbours from
/// `start` and its shift on.
mlir::Value ArrayLowering::isWindow(const LaneWindow &window,
                                    mlir::Value start) {
  UpdateLanesOp first = window.front().update;
  int64_t lanes = countLanes(first);
  auto type = cast<VectorType>(first.getIndices().back().getType());
  unsigned bits = type.getElementTypeBitWidth();
  mlir::Value base = spread(b, loc, start, lanes), differ;
  for (const WindowUpdate &one : window) {
    SmallVector<APInt> numbers;
    for (int64_t lane = 0; lane < lanes; ++lane)
      numbers.emplace_back(bits, lane + one.shift, /*isSigned=*/true);
    mlir::Value away = arith::ConstantOp::create(
        b, loc, DenseElementsAttr::get(type, ArrayRef<APInt>(numbers)));
    UpdateLanesOp update = one.update;
    mlir::Value differs =
        arith::XOrIOp::create(b, loc, update.getIndices().back(),
                              arith::AddIOp::create(b, loc, base, away));
    differ = differ ? arith::OrIOp::create(b, loc, differ, differs) : differs;
  }
  mlir::Value zero = arith::ConstantOp::create(b, loc, b.getZeroAttr(type));
  mlir::Value holds =
      arith::CmpIOp::create(b, loc, arith::CmpIPredicate::eq, differ, zero);
  if (!isFullMask(first.getMask()))
    holds = arith::AndIOp::create(b, loc, holds, first.getMask());
  mlir::Type word = b.getIntegerType(lanes);
  mlir::Value all = arith::ConstantOp::create(
      b, loc, b.getIntegerAttr(word, APInt::getAllOnes(lanes)));
  mlir::Value is =
      arith::CmpIOp::create(b, loc, arith::CmpIPredicate::eq,
                            LLVM::BitcastOp::create(b, loc, word, holds), all);
  mlir::Value least =
      arith::ConstantOp::create(b, loc, b.getIntegerAttr(start.getType(), 0));
  mlir::Value isRight =
      arith::CmpIOp::create(b, loc, arith::CmpIPredicate::sge, start, least);
  return arith::AndIOp::create(b, loc, is, isRight);
}

void ArrayLowering::updateWindow(const LaneWindow &window) {
  const WindowUpdate *lowest = llvm::min_element(
      window, [](const WindowUpdate &a, const WindowUpdate &b) {
        return a.shift < b.shift;
      });
  UpdateLanesOp first = lowest->update;
  mlir::Value zero = arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(0));
  mlir::Value start =
      LLVM::ExtractElementOp::create(b, loc, first.getIndices().back(), zero);
  auto branch = scf::IfOp::create(b, loc, isWindow(window, start),
                                  /*withElseRegion=*/true);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(branch.elseBlock());
  for (const WindowUpdate &one : window)
    updateNeighbours(one.update);

  b.setInsertionPointToStart(branch.thenBlock());
  ArrayParts parts = getParts(first.getArray());
  LaneAccess access;
  collectLeaves(elementType(first.getArray()), 0, access.leaves);
  access.lanes = countLanes(first);
  SmallVector<mlir::Value> from;
  for (auto [index, extent, isRight] : llvm::zip(
           first.getIndices().drop_back(), parts.shape, first.getNonNegative()))
    from.push_back(isRight ? index : wrapIndex(index, extent));
  from.push_back(start);
  mlir::Value begin =
      elementPointer(parts, from, elementType(first.getArray()));
  mlir::Type scalar = access.leaves[0].type;
  int64_t lanes = access.lanes, span = 0;
  VectorType type = storedLanes(scalar, lanes);
  ShiftTree tree(b, loc, type, scalar);
  for (const WindowUpdate &one : window)
    span = std::max(span, one.shift);
  SmallVector<mlir::Value> terms(llvm::alignTo(span + 1, lanes));
  for (const WindowUpdate &one : window) {
    UpdateLanesOp update = one.update;
    mlir::Value &term = terms[one.shift];
    term = tree.add(term, update.getComponents()[0]);
  }
  mlir::Value carried;
  for (int64_t at = 0; at < span + lanes; at += lanes) {
    ShiftedSum sums;
    if (at <= span)
      sums = tree.sum(ArrayRef(terms).slice(at, lanes));
    access.isFull = at <= span;
    access.mask = prefixMask(b, loc, lanes, span + lanes - at);
    access.pointer = advance(begin, at * getByteSize(scalar));
    mlir::Value value = tree.add(carried, sums.low);
    mlir::Value before = loadUnit(access, /*stride=*/1)[0];
    storeUnit(access, /*stride=*/1, tree.add(before, value));
    carried = sums.high;
  }
}

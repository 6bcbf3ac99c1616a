//===- DisjointWindows.cpp - Windows of arrays of single blocks -----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// If block i reads and writes an array within [c i, c i + c) of one axis and
// nowhere else, it needs no atomic instructions: the adjoint of a load by
// blocks that lie side by side adds plainly.
//
//===----------------------------------------------------------------------===//

#include "DisjointWindows.h"

#include "KernelFunction.h"

using namespace mlir;

namespace warp::tiles {

namespace {

/// An argument, or its gradient, and what the leading axes are fixed at.
struct Root {
  Value base;
  bool isGradient = false;
  SmallVector<Value> leading;

  bool is(const Root &other) const {
    return base == other.base && isGradient == other.isGradient;
  }
};

/// First elements and extents along the axes of a root.
using Window = SmallVector<std::pair<Value, int64_t>>;

} // namespace

static Root rootOf(Value array) {
  Root root;
  while (Operation *def = array.getDefiningOp()) {
    if (auto view = dyn_cast<ViewOp>(def)) {
      root.leading.insert(root.leading.begin(), view.getIndices().begin(),
                          view.getIndices().end());
      array = view.getArray();
    } else if (auto gradient = dyn_cast<GradOp>(def)) {
      root.isGradient = true;
      array = gradient.getArray();
    } else {
      return root;
    }
  }
  auto argument = cast<BlockArgument>(array);
  if (isa<FunctionOpInterface>(argument.getOwner()->getParentOp()))
    root.base = array;
  return root;
}

static std::optional<Window> windowOf(Operation *op, const Root &root) {
  auto access = dyn_cast<TileAccessOp>(op);
  if (!access || access.getPicked())
    return std::nullopt;
  Window window;
  for (Value index : root.leading)
    window.push_back({index, 1});
  for (auto [offset, extent] :
       llvm::zip_equal(access.getOffsets(), access.getTileType().getShape()))
    window.push_back({offset, extent});
  return window;
}

int64_t getDisjointStep(const Form &first, int64_t extent, unsigned dim) {
  if (first.terms.size() != 1 || first.constant < 0)
    return 0;
  const Term &term = first.terms[0];
  bool isThread =
      term.product.size() == 1 && term.product[0] == Symbol::thread(dim);
  int64_t most = std::numeric_limits<int32_t>::max();
  bool fits = term.factor <= most && first.constant <= most &&
              first.constant + extent <= term.factor;
  return isThread && fits ? term.factor : 0;
}

std::optional<DisjointSteps> findDisjointSteps(FunctionOpInterface kernel,
                                               TileAccessOp update) {
  Root mine = rootOf(update.getArray());
  if (!mine.base || !getVariant(kernel).getDisjoint())
    return std::nullopt;
  SmallVector<Window> windows;
  bool isKnown = true;
  kernel->walk([&](Operation *op) {
    if (isa<ViewOp, GradOp, DimOp>(op))
      return;
    for (Value operand : op->getOperands()) {
      if (!isa<ArrayType>(operand.getType()))
        continue;
      Root root = rootOf(operand);
      if (root.base && !root.is(mine))
        continue;
      std::optional<Window> window =
          root.base ? windowOf(op, root) : std::nullopt;
      isKnown &= window &&
                 (windows.empty() || window->size() == windows.front().size());
      if (window)
        windows.push_back(*window);
    }
  });
  if (!isKnown)
    return std::nullopt;
  Forms forms;
  auto commonStep = [&](unsigned axis, unsigned dim) -> int64_t {
    int64_t common = 0;
    for (auto [i, window] : llvm::enumerate(windows)) {
      auto [first, extent] = window[axis];
      int64_t step = getDisjointStep(forms.of(first), extent, dim);
      if (step == 0 || (i > 0 && step != common))
        return 0;
      common = step;
    }
    return common;
  };
  DisjointSteps steps(getVariant(kernel).getRank(), 0);
  // The last dimension is that of a block's threads.
  unsigned dims = steps.size() - (getTarget(kernel).isSimt() ? 1 : 0);
  for (unsigned dim = 0; dim < dims; ++dim)
    for (unsigned axis = 0; axis < windows.front().size() && !steps[dim];
         ++axis)
      steps[dim] = commonStep(axis, dim);
  if (llvm::all_of(steps, [](int64_t step) { return step == 0; }))
    return std::nullopt;
  return steps;
}

} // namespace warp::tiles

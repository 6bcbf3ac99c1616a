//===- Ranges.h - Integer range analysis ------------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_ANALYSIS_RANGES_H
#define WARP_LIB_ANALYSIS_RANGES_H

#include "Forms.h"

#include "llvm/ADT/PointerIntPair.h"

#include <vector>

namespace warp {

/// low <= value <= high. Wide enough for products of what 64 bits hold.
struct Interval {
  using Number = __int128;
  Number low, high;

  bool isWithin(const Interval &other) const {
    return other.low <= low && high <= other.high;
  }
};

/// The use of a value.
enum class Use : bool {
  /// Anything: a sum may wrap.
  Exact,
  /// An index: a sum or product of which that would wrap is out of bounds, so
  /// it may be taken not to. That holds for the index itself, not for what a
  /// remainder (say, of a hash) is taken of.
  Index,
};

/// Finds ranges, from types, operations, forms, and the conditions of branches
/// and loops around a block. Ask a new one after a change of the program.
class Ranges {
public:
  explicit Ranges(Forms &forms) : forms(forms) {}

  /// The range of an integer: in a block, or wherever it is.
  Interval of(mlir::Value value, mlir::Block *at = nullptr,
              Use use = Use::Exact);

private:
  /// A value, the block that it is asked about in, and what it is used for.
  using Context = llvm::PointerIntPair<mlir::Block *, 1, Use>;
  using Place = std::pair<mlir::Value, Context>;
  /// greater - less >= least, for two values of a type.
  struct Bound {
    Form greater, less;
    int64_t least;
    mlir::Type type;
  };

  llvm::SmallVector<Place, 2> getParts(Place place);
  Interval combine(Place place);
  Interval fromOperation(Place place);
  Interval fromArgument(mlir::BlockArgument argument, Context context);
  Interval fromForm(const Form &form, Place place);
  Interval ofSymbol(Symbol symbol, Place place);
  void refine(const Form &form, Place place, Interval &range);
  const std::vector<Bound> &getBounds(mlir::Block *block);
  void addCondition(mlir::Value condition, bool truth,
                    std::vector<Bound> &bounds);
  void addComparison(mlir::Operation *op, bool truth,
                     std::vector<Bound> &bounds);

  Forms &forms;
  llvm::DenseMap<Place, Interval> known;
  llvm::DenseMap<mlir::Block *, std::unique_ptr<std::vector<Bound>>> boundsAt;
};

/// True if an index can be told not to be negative, in a block if that helps.
/// For several questions ask one ThreadVariance.
bool isNonNegative(mlir::Value index, mlir::Block *where);

} // namespace warp

#endif // WARP_LIB_ANALYSIS_RANGES_H

//===- Forward.h - Forward mode: tangents of a kernel -----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_FORWARD_H
#define WARP_TRANSFORMS_AUTODIFF_FORWARD_H

#include "Autodiff/HiddenArguments.h"
#include "Autodiff/Activity.h"
#include "Autodiff/Rules/Rules.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/IR/IRMapping.h"

namespace warp {
class AccessOp;
class ArrayAtOp;
} // namespace warp

namespace warp::autodiff {

struct ForwardOptions {
  /// Per array leaf: it has tangents. Empty: all have.
  llvm::SmallVector<bool> active;
  Singular singular = Singular::Pinned;
  /// Threads that meet repeated singular values or eigenvalues are counted, as
  /// tangents of their vectors are zero there (HiddenKind::Counters).
  bool countRepeated = false;
  /// Directions that tangents are computed along at once.
  unsigned width = 1;
  /// Nothing is computed but who has won at atomic minima and maxima; for a
  /// second launch (ForwardExtrema.cpp).
  bool winners = false;
};

/// Tangents of primal values; of an array, its twin. Absent: zero.
using TangentMap = llvm::DenseMap<mlir::Value, mlir::Value>;

/// Values that may have a tangent: floats and arrays of them.
class Varied {
public:
  Varied(mlir::func::FuncOp kernel, const ArrayLeaves &leaves,
         llvm::ArrayRef<bool> active);

  bool contains(mlir::Value value) const { return values.contains(value); }
  /// Positions of those that may have a tangent.
  llvm::SmallVector<unsigned> select(mlir::ValueRange range) const;

private:
  bool mark(mlir::Value value);
  bool spread(mlir::Operation *op);
  bool spreadThroughControlFlow(mlir::Operation *op);

  llvm::DenseSet<mlir::Value> values;
};

/// Builds the kernel that computes tangents beside values; Forward.cpp explains
/// how.
class ForwardBuilder {
public:
  ForwardBuilder(mlir::func::FuncOp primal, mlir::func::FuncOp dual,
                 const ForwardOptions &options);

  /// Fills the body of the dual kernel and adds its arguments.
  mlir::LogicalResult build();
  /// Places with repeated values, in the order of the counters.
  llvm::ArrayRef<mlir::Location> getRepeatedPlaces() const {
    return repeatedPlaces;
  }

private:
  void addTwins();
  mlir::LogicalResult run(mlir::Block &block);
  mlir::LogicalResult run(mlir::Operation *op);
  mlir::LogicalResult runRegions(mlir::Operation *op);
  mlir::LogicalResult runCall(mlir::func::CallOp op);
  mlir::LogicalResult runCustom(mlir::func::CallOp op,
                                mlir::func::FuncOp callee);
  void pushCustom(mlir::func::CallOp op, mlir::func::CallOp clone,
                  mlir::ValueRange results,
                  mlir::FlatSymbolRefAttr pushforward);
  void transposeCustom(mlir::func::CallOp op, mlir::func::CallOp clone,
                       mlir::ValueRange results,
                       mlir::FlatSymbolRefAttr pullback);
  mlir::Value dotTangents(mlir::func::CallOp op, mlir::ValueRange cotangents,
                          const TangentMap &tangents);
  mlir::LogicalResult runRule(mlir::Operation *op, mlir::Operation *clone);
  void countRepeated(mlir::Location loc, mlir::Value isRepeated);
  /// In the launch that looks for winners. Returns nothing for what it does
  /// like the other one.
  std::optional<mlir::LogicalResult> runForWinners(mlir::Operation *op);
  mlir::LogicalResult assignWinner(AccessOp op);
  mlir::LogicalResult checkRead(mlir::Operation *op, mlir::Value array);
  mlir::LogicalResult checkUpdates(AccessOp op, unsigned leaf);
  void collectUpdates();
  mlir::Value claimsOf(mlir::Value array);
  /// Returns nothing if the operation touches no memory.
  std::optional<mlir::LogicalResult> runMemory(mlir::Operation *op,
                                               mlir::Operation *clone,
                                               TangentMap &tangents);
  mlir::LogicalResult runAccess(AccessOp op, mlir::Operation *clone,
                                TangentMap &tangents);
  mlir::LogicalResult runUpdate(AccessOp op, mlir::Operation *clone,
                                TangentMap &tangents);
  mlir::Operation *accessTwin(mlir::Operation *clone, mlir::Value twin,
                              mlir::Value tangent);
  /// Views and other descriptors made of an array: the same of its twin.
  mlir::Value viewTwin(mlir::Operation *clone, mlir::Value twin);
  mlir::Value twinAt(ArrayAtOp clone, unsigned direction);

  void forget(mlir::ValueRange primals);

  /// Opens a block for `from`, with arguments for the tangents of those at
  /// `carried`, which are counted from `first`.
  void openBlock(mlir::Region &region, mlir::Block &from, unsigned first,
                 llvm::ArrayRef<unsigned> carried);
  mlir::LogicalResult closeBlock(mlir::Block &from, unsigned first,
                                 llvm::ArrayRef<unsigned> carried);

  llvm::SmallVector<mlir::Value> lookup(mlir::ValueRange primals) const;
  /// The tangents of those at `carried`, zeros made explicit.
  mlir::LogicalResult appendTangents(mlir::Location loc, mlir::ValueRange range,
                                     llvm::ArrayRef<unsigned> carried,
                                     llvm::SmallVectorImpl<mlir::Value> &to);
  mlir::Value getTangentOrZero(mlir::Value primal, const TangentMap &tangents);

  mlir::OpBuilder builder;
  const ForwardOptions &options;
  mlir::func::FuncOp primal, dual;
  ArrayLeaves leaves;
  Varied varied;
  mlir::IRMapping values;
  /// Tangents along each direction. They differ in values, never in which are
  /// absent.
  llvm::SmallVector<TangentMap, 1> directions;
  /// Twins of the arrays of the arguments, one for each direction or none.
  llvm::SmallVector<llvm::SmallVector<mlir::Value, 1>> twins;
  /// For winners, by array: what writes to it, and the argument in which a
  /// thread claims an element.
  llvm::SmallVector<llvm::SmallVector<mlir::Operation *, 1>> updates;
  llvm::SmallVector<mlir::Value> claims;
  /// Counters of repeated values, and where they are of.
  mlir::Value counters;
  llvm::SmallVector<mlir::Location> repeatedPlaces;
};

/// Makes atomic minima and maxima of composites those of their components.
void splitExtrema(mlir::func::FuncOp kernel);

/// The operation that writes to an array, a view of it, or the parameter that
/// it is passed for; null if nothing does.
mlir::Operation *findWrite(mlir::Value array);

/// True if calls of a function have a derivative, whatever its body.
bool hasOwnDerivative(mlir::func::FuncOp callee);

/// Type of the tangent of a value or array; null if it has none.
mlir::Type getTangentType(mlir::Type type);

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_FORWARD_H

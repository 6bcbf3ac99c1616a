//===- LowerComposites.h - State of the lowering to thread IR ---*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_LOWERCOMPOSITES_H
#define WARP_TRANSFORMS_LOWERCOMPOSITES_H

#include "Lowerings/Scalar.h"

#include "mlir/IR/Operation.h"

namespace mlir {
class FunctionOpInterface;
namespace arith {
class SelectOp;
} // namespace arith
} // namespace mlir

namespace warp {

class ScratchOp;
class ScratchLoadOp;
class ScratchStoreOp;
class TableGetOp;

/// Lowers a function: its body and its signature.
llvm::LogicalResult lowerComposites(mlir::FunctionOpInterface function);

/// Types of the values that thread IR has in place of these.
llvm::SmallVector<mlir::Type> flattenToThreadTypes(mlir::TypeRange types);

/// Lowers the body of one function, operation after operation.
class CompositeLowering {
public:
  CompositeLowering(mlir::MLIRContext *context, mlir::Block *entry)
      : emitter(context, entry) {}

  /// Converts the arguments of a block; the old ones go in `cleanUp`.
  void convertArguments(mlir::Block &block);
  llvm::LogicalResult lower(mlir::Block &block);
  /// Erases what was replaced.
  void cleanUp();

private:
  llvm::LogicalResult lower(mlir::Operation *op);
  llvm::LogicalResult lowerControlFlow(mlir::Operation *op);
  llvm::LogicalResult lowerSelect(mlir::arith::SelectOp op);
  llvm::LogicalResult lowerBuiltin(mlir::Operation *op);
  /// Both return nothing if the operation is none of theirs.
  std::optional<llvm::LogicalResult> lowerValueOp(mlir::Operation *op);
  std::optional<llvm::LogicalResult> lowerArrayOp(mlir::Operation *op);

  void lowerScratch(ScratchOp op);
  void lowerScratch(ScratchLoadOp op);
  void lowerScratch(ScratchStoreOp op);

  /// The values that now stand for an operand.
  llvm::ArrayRef<mlir::Value> lookup(mlir::Value value);
  mlir::Value lookupOne(mlir::Value value) { return lookup(value).front(); }
  llvm::SmallVector<mlir::Value> lookup(mlir::ValueRange values);
  /// The components of a value that holds no array.
  lowering::Scalars getScalars(mlir::Value value);
  lowering::Scalar getScalar(mlir::Value value) { return getScalars(value)[0]; }

  /// Says what stands for a result from now on.
  void map(mlir::Value from, mlir::ValueRange to);
  void replace(mlir::Operation *op, mlir::ValueRange flat);
  void replace(mlir::Operation *op, llvm::ArrayRef<lowering::Scalar> flat);

  /// The same operation with these operands and flattened results.
  mlir::Operation *rebuild(mlir::Operation *op, mlir::ValueRange operands);

  /// An index with at least 32 bits that keeps its value when taken as signed.
  mlir::Value getIndex(mlir::Value index);
  /// The components at an index along an axis of `extent` groups.
  lowering::Scalars pick(lowering::Scalars scalars, int64_t extent,
                         mlir::Value index);
  lowering::Scalars put(lowering::Scalars scalars, int64_t extent,
                        mlir::Value index, lowering::Scalars part);
  lowering::Scalars putAt(mlir::Type composite, lowering::Scalars scalars,
                          mlir::ValueRange indices, lowering::Scalars part);
  mlir::Value lowerTable(TableGetOp op);
  lowering::Scalars reinterpret(lowering::Scalars scalars, mlir::Type to);

  lowering::Emitter emitter;
  /// Ranges of `pool`, for values that no longer stand for themselves.
  llvm::DenseMap<mlir::Value, std::pair<unsigned, unsigned>> ranges;
  llvm::SmallVector<mlir::Value, 128> pool;
  /// In an order in which uses come after definitions.
  llvm::SmallVector<mlir::Operation *, 64> dead;
  llvm::SmallVector<std::pair<mlir::Block *, unsigned>, 8> deadArguments;
};

} // namespace warp

#endif // WARP_TRANSFORMS_LOWERCOMPOSITES_H

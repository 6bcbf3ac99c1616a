//===- BlockReduce.h - Block reductions -------------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_BLOCKREDUCE_H
#define WARP_LIB_TRANSFORMS_BLOCKREDUCE_H

#include "WarpDialect/WarpOps.h"

#include "mlir/IR/Builders.h"
#include "mlir/IR/BuiltinOps.h"

namespace warp {

/// A value of each thread that is combined with those of the others. `type`
/// still has its sign.
struct Reduced {
  AtomicKind kind;
  mlir::Value value, identity;
  mlir::Type type;
};

/// Combines values over the threads of a block whose size is a multiple of the
/// warp's 32. All of them must come to the insertion point.
class BlockReduce {
public:
  /// Reads the thread's place in its block at the insertion point.
  BlockReduce(mlir::OpBuilder &b, mlir::Location loc, mlir::ModuleOp module,
              int64_t blockDim);

  /// True if `condition` holds for any thread; all threads learn it.
  mlir::Value any(mlir::Value condition);
  /// The combinations of all threads, in the first thread of the block.
  llvm::SmallVector<mlir::Value> reduce(llvm::ArrayRef<Reduced> reduced);

private:
  mlir::Value constant(int64_t value);
  mlir::Value overWarp(AtomicKind kind, mlir::Value value, mlir::Type type);
  mlir::Value reduceOne(const Reduced &reduced);
  llvm::SmallVector<mlir::Value>
  reduceTogether(AtomicKind kind, llvm::ArrayRef<mlir::Value> values,
                 mlir::Type type);
  void overRows(AtomicKind kind, int64_t slots, mlir::Type type,
                llvm::function_ref<mlir::Value(mlir::Value)> slot);

  mlir::OpBuilder &b;
  mlir::Location loc;
  mlir::ModuleOp module;
  int64_t warpSize, warps;
  mlir::Value thread, lane;
};

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_BLOCKREDUCE_H

//===- LocalMemory.h - Composites in thread-private memory ------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_COMPOSITES_LOCALMEMORY_H
#define WARP_TRANSFORMS_COMPOSITES_LOCALMEMORY_H

#include "WarpDialect/WarpOps.h"

#include "mlir/IR/Builders.h"

namespace warp {

/// The components of a composite, in memory from a slot on.
struct Stored {
  mlir::Value memory;
  /// An `i32`; none for the first slot.
  mlir::Value base;

  explicit operator bool() const { return bool(memory); }
  bool operator==(const Stored &other) const {
    return memory == other.memory && base == other.base;
  }
};

/// Builds accesses to composites in memory of a thread.
class LocalMemory {
public:
  explicit LocalMemory(mlir::Block &entry)
      : b(entry.getParentOp()->getContext()), entry(entry) {}

  /// Inserts the next operations in front of an operation.
  void moveTo(mlir::Operation *op) {
    b.setInsertionPoint(op);
    loc = op->getLoc();
  }
  void moveAfter(mlir::Value value);

  /// Room for a number of composites.
  Stored allocate(mlir::Type composite, int64_t count = 1);
  /// One of those at a slot for composites.
  Stored at(Stored all, mlir::Type composite, mlir::Value slot);

  void copy(mlir::Type composite, Stored from, Stored to);
  /// Stores all components of a value.
  void fill(mlir::Value composite, Stored to);
  /// Loads all components.
  mlir::Value load(mlir::Type composite, Stored from);
  /// The result of an extraction, and the effect of an insertion.
  mlir::Value load(ExtractOp op, Stored from);
  void store(InsertOp op, Stored to);

  mlir::OpBuilder b;

private:
  mlir::Value constant(int64_t number);
  mlir::Value slot(Stored stored, mlir::Value index);
  mlir::Value get(Stored from, mlir::Value index);
  void put(mlir::Value number, Stored to, mlir::Value index);
  void repeat(int64_t count, llvm::function_ref<void(mlir::Value)> body);
  mlir::Value normalize(mlir::Value index, int64_t extent);
  llvm::SmallVector<mlir::Value> slotsOf(mlir::Type composite,
                                         mlir::ValueRange indices);
  mlir::Value extract(mlir::Value composite, llvm::ArrayRef<int64_t> indices);

  mlir::Block &entry;
  mlir::Location loc = b.getUnknownLoc();
};

} // namespace warp

#endif // WARP_TRANSFORMS_COMPOSITES_LOCALMEMORY_H

//===- Rotation.h - Tiles of a loop whose sums travel -----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// RingReduction.cpp explains the schedule, RingReductionTiles.cpp builds what
// goes before a loop.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_ROTATION_H
#define WARP_LIB_TRANSFORMS_ROTATION_H

#include "RingLoop.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/IR/Builders.h"
#include "mlir/IR/IRMapping.h"

namespace warp {

/// Puts tiles in front of one loop.
class Rotation {
public:
  static constexpr int64_t lanes = RingLoop::lanes;

  /// `ring` is that of the loop.
  Rotation(mlir::scf::ForOp loop, mlir::LLVM::LLVMFuncOp entry,
           const RingLoop &ring);

  void run();

private:
  /// An update whose sums travel.
  struct Update {
    AtomicComponentsOp op;
    /// Types of the components, with their sign.
    llvm::SmallVector<mlir::Type> types;
    /// Memory of the thread with the sum of each component.
    llvm::SmallVector<mlir::Value> slots;
    /// If an iteration may leave the update out: memory with a bit for each
    /// iteration of the tile that did not.
    mlir::Value reached;

    bool isConditional() {
      return !mlir::isa<mlir::scf::ForOp>(op->getParentOp());
    }
  };

  void makeSlots();
  mlir::Value endOfTiles();
  void buildTile(mlir::Value tile, mlir::ValueRange carried);
  void buildStep(mlir::Value tile, mlir::Value number,
                 mlir::ValueRange carried);
  void accumulate(Update &update, AtomicComponentsOp op, mlir::Value offset);
  void publish(Update &update, mlir::Value iteration);
  mlir::Value cloneIndex(mlir::Value value, mlir::IRMapping &clones);

  mlir::Type counterType() { return loop.getInductionVar().getType(); }
  mlir::Value constant(mlir::Type type, int64_t value) {
    return mlir::arith::ConstantOp::create(b, loc,
                                           b.getIntegerAttr(type, value));
  }
  mlir::Value constant(int64_t value) {
    return constant(b.getI32Type(), value);
  }
  mlir::Value add(mlir::Value x, mlir::Value y) {
    return mlir::arith::AddIOp::create(b, loc, x, y);
  }
  mlir::Value bitAnd(mlir::Value x, mlir::Value y) {
    return mlir::arith::AndIOp::create(b, loc, x, y);
  }
  mlir::Value bitOr(mlir::Value x, mlir::Value y) {
    return mlir::arith::OrIOp::create(b, loc, x, y);
  }
  mlir::Value compare(mlir::arith::CmpIPredicate predicate, mlir::Value x,
                      mlir::Value y) {
    return mlir::arith::CmpIOp::create(b, loc, predicate, x, y);
  }
  /// A lane or step as a counter of the loop.
  mlir::Value widen(mlir::Value x) {
    if (counterType() == x.getType())
      return x;
    return mlir::arith::ExtUIOp::create(b, loc, counterType(), x);
  }
  mlir::Value load(mlir::Value slot, mlir::Type type) {
    return mlir::LLVM::LoadOp::create(b, loc, type, slot);
  }
  void store(mlir::Value value, mlir::Value slot) {
    mlir::LLVM::StoreOp::create(b, loc, value, slot);
  }

  mlir::scf::ForOp loop;
  mlir::LLVM::LLVMFuncOp entry;
  mlir::OpBuilder b;
  mlir::Location loc;
  llvm::SmallVector<Update> updates;
  /// What lanes must agree on for bounds and indices to be the same.
  llvm::SetVector<mlir::Value> compared;
  /// This lane's number, and that of the next.
  mlir::Value lane, next;
};

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_ROTATION_H

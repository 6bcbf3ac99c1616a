//===- Atomics.h - Values that atomic updates compute -----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_ATOMICS_H
#define WARP_LIB_TRANSFORMS_ATOMICS_H

#include "WarpDialect/ParameterLayout.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/IR/Builders.h"
#include "mlir/IR/IRMapping.h"

namespace warp {

/// The value that an update of `old` by `value` leaves. `type` still has its
/// sign. With `anyOrder` a sum may be reassociated.
mlir::Value combine(mlir::OpBuilder &b, mlir::Location loc, AtomicKind kind,
                    mlir::Value old, mlir::Value value, mlir::Type type,
                    bool anyOrder = false);

/// A number with its sign changed.
mlir::Value negate(mlir::OpBuilder &b, mlir::Location loc, mlir::Value value);

/// How results of an update combine: subtracting is adding a negative.
AtomicKind combiningKind(AtomicKind kind);

/// How an update is to be made: as warp-plan-updates says, by each thread where
/// that has not been.
UpdateAttr getUpdate(mlir::Operation *update);
void setUpdate(mlir::Operation *update, UpdateScope scope, int64_t run = 0);

/// The parts of the element that an update is of.
llvm::SmallVector<Leaf> leavesOf(AtomicComponentsOp update);

/// True if an update may be made later, and others of its array before it: its
/// old value is unused, and nothing in the kernel does anything else to the
/// array than update it in a way that commutes. Exact sums go their own way.
bool commutes(AtomicComponentsOp update);
/// True if partial results may be combined besides: those of fewer than 32 bits
/// would round.
bool canCombine(AtomicComponentsOp update);

/// The value that changes nothing when it is combined. `type` still has its
/// sign.
mlir::Value identity(mlir::OpBuilder &b, mlir::Location loc, AtomicKind kind,
                     mlir::Type type);

/// True if a value in an entry whose body begins with `first` is the same for
/// every thread of the range, and safe to compute again.
bool isInvariant(mlir::Value value, mlir::Block *first);
/// Computes it again, at an insertion point that `first` dominates.
mlir::Value cloneInvariant(mlir::OpBuilder &b, mlir::Value value,
                           mlir::Block *first, mlir::IRMapping &clones);

/// True if an update says, or leaves, who came first: old values that are used,
/// exchanges. Never of exact sums.
bool tellsTurn(mlir::Operation *update);

/// The same of native code with atomics.
bool mayTellTurn(mlir::Operation *op);
/// True if an entry has such operations.
bool mayTellTurns(mlir::Operation *entry);

/// True if a kernel's threads have to come to such operations in turn. Set for
/// launches on a CPU that the caller wants in order.
bool keepsTurns(mlir::Operation *entry);

/// True if the order of atomic updates in an entry may show: sums of floats
/// round unless they are exact, and some updates tell who came first.
bool dependsOnOrder(mlir::Operation *update);
bool hasOrderedUpdates(mlir::Operation *entry);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_ATOMICS_H

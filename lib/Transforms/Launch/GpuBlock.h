//===- GpuBlock.h - Threads and memory of a GPU block -----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_GPUBLOCK_H
#define WARP_LIB_TRANSFORMS_GPUBLOCK_H

#include "Analysis/GridReads.h"
#include "Targets/Target.h"

#include "mlir/IR/Builders.h"
#include "mlir/IR/BuiltinOps.h"

namespace warp {

/// The target of the kernel that code is built for.
const TargetInfo &targetAt(mlir::OpBuilder &b);
/// Lanes of its subgroups ("warps").
inline int64_t subgroupSizeAt(mlir::OpBuilder &b) {
  return targetAt(b).getSubgroupSize();
}
/// Number of the subgroup of a thread of a block.
mlir::Value subgroupOf(mlir::OpBuilder &b, mlir::Location loc,
                       mlir::Value thread);
/// Address space of the memory that the threads of a block share.
constexpr unsigned sharedSpace = 3;

/// For passes whose code for a GPU has operations of the `gpu` dialect.
void registerGpuDialect(mlir::DialectRegistry &registry);

//===----------------------------------------------------------------------===//
// Operations of the `gpu` dialect
//===----------------------------------------------------------------------===//

/// Reads it, as i32.
mlir::Value readGrid(mlir::OpBuilder &b, mlir::Location loc, GridValue value,
                     Axis axis = Axis::x);

/// The lane that the operand `lane` of a shuffle means: this one, or one at
/// that distance from the own.
enum class ShuffleMode { index, down, exclusiveOr };

/// A value of 32 or 64 bits of another lane. All lanes of the warp must get
/// here.
mlir::Value shuffle(mlir::OpBuilder &b, mlir::Location loc, ShuffleMode mode,
                    mlir::Value value, mlir::Value lane);

/// True if an operation exchanges values between lanes, so that it must stay
/// where all of them get to, though it does nothing to memory.
bool isShuffle(mlir::Operation *op);

/// Number of the thread in its block, which has any number of axes.
mlir::Value threadInBlock(mlir::OpBuilder &b, mlir::Location loc);

/// The combination over all lanes of the warp, or over each `size` of them that
/// follow each other, a power of two; all of them must get here, and get it.
mlir::Value
overLanes(mlir::OpBuilder &b, mlir::Location loc, mlir::Value value,
          llvm::function_ref<mlir::Value(mlir::Value, mlir::Value)> combine,
          int64_t size = 0);

/// The same for as many values as there are lanes, at most, of which each lane
/// gets one, and lanes with the same one follow each other: with `n` values and
/// `n` a power of two, lane `k` of `size` gets that at `k * n / size`. Other
/// numbers are like the next power of two, and what lanes get beyond the last
/// value means nothing. With `size`, over each of so many lanes.
mlir::Value shareOverLanes(
    mlir::OpBuilder &b, mlir::Location loc, mlir::Value lane,
    llvm::SmallVector<mlir::Value> values,
    llvm::function_ref<mlir::Value(mlir::Value, mlir::Value)> combine,
    int64_t size = 0);

/// Waits for all threads of the block.
void synchronizeBlock(mlir::OpBuilder &b, mlir::Location loc);

//===----------------------------------------------------------------------===//
// Votes and barriers of the target
//===----------------------------------------------------------------------===//

/// True if all lanes of the warp get here together.
mlir::Value isFullWarp(mlir::OpBuilder &b, mlir::Location loc);

/// True if a condition holds in all lanes of a full warp.
mlir::Value holdsInWarp(mlir::OpBuilder &b, mlir::Location loc,
                        mlir::Value condition);

/// True if all lanes of the warp come to the insertion point together and agree
/// on these values.
mlir::Value isWarpTogether(mlir::OpBuilder &b, mlir::Location loc,
                           llvm::ArrayRef<mlir::Value> compared);

/// Lanes of a warp at one place, some of which do something there.
struct WarpVote {
  /// True if all lanes came together, enough of them do it, and those of each
  /// group agree.
  mlir::Value together;
  /// True if a lane of the group does it.
  mlir::Value any;
  /// The values that the group agrees on, the same in all its lanes.
  llvm::SmallVector<mlir::Value> agreed;
};

/// Compares `values` over the lanes in which `doesIt` holds, in groups of
/// `size` lanes that follow each other; in all, there have to be `least`.
WarpVote voteInWarp(mlir::OpBuilder &b, mlir::Location loc, mlir::Value doesIt,
                    mlir::ValueRange values, int64_t size, int64_t least);

/// The largest trips, an i32 or i64 that is not negative, of the lanes that
/// are here.
mlir::Value mostInWarp(mlir::OpBuilder &b, mlir::Location loc,
                       mlir::Value trips);

/// True if a condition holds in any thread of the block; waits for all of them.
mlir::Value holdsAnywhere(mlir::OpBuilder &b, mlir::Location loc,
                          mlir::Value condition);

/// A bit for each lane of the warp that gets here together with this one.
mlir::Value activeLanes(mlir::OpBuilder &b, mlir::Location loc);

/// True if a value of 64 bits is the same in all of `lanes`, which are here.
mlir::Value agreesInLanes(mlir::OpBuilder &b, mlir::Location loc,
                          mlir::Value value, mlir::Value lanes);

/// Waits for the lanes of a full warp, or for `lanes`, and what they did to
/// memory.
void synchronizeWarp(mlir::OpBuilder &b, mlir::Location loc,
                     mlir::Value lanes = {});

//===----------------------------------------------------------------------===//
// Memory of a block
//===----------------------------------------------------------------------===//

/// Address of new shared memory, a variable whose name begins with `name`.
mlir::Value makeShared(mlir::OpBuilder &b, mlir::Location loc,
                       mlir::ModuleOp module, mlir::Type type,
                       llvm::StringRef name, int64_t alignment = 8);
/// Bytes of all that a module has, of which a block may have
/// `staticBlockBytes`.
int64_t sharedBytes(mlir::ModuleOp module);
/// Address of the shared memory that a launch asks for.
mlir::Value nameDynamicShared(mlir::OpBuilder &b, mlir::Location loc,
                              mlir::ModuleOp module, llvm::StringRef name);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_GPUBLOCK_H

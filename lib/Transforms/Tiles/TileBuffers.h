//===- TileBuffers.h - Buffer sharing of tiles ------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_TILES_TILEBUFFERS_H
#define WARP_TRANSFORMS_TILES_TILEBUFFERS_H

#include "WarpDialect/TileOps.h"
#include "WarpDialect/TilePasses.h"
#include "WarpDialect/WarpDialect.h"

#include "mlir/IR/BuiltinOps.h"
#include "mlir/Interfaces/FunctionInterfaces.h"
#include "llvm/ADT/EquivalenceClasses.h"
#include "llvm/ADT/SetVector.h"

namespace warp::tiles {

/// Attributes that the passes about tiles leave for each other.
namespace attr {
/// Number of the operand whose memory the result takes over.
constexpr llvm::StringLiteral inPlace = "in_place";
/// Offsets of the results in shared memory, in bytes, one per result.
constexpr llvm::StringLiteral offsets = "offsets";
/// The offset of the operation's scratch memory.
constexpr llvm::StringLiteral scratch = "scratch";
/// On a software-pipelined loop: its stages, which are those of its loads.
constexpr llvm::StringLiteral stages = "warp.stages";
} // namespace attr

/// Threads of the blocks that a kernel is for; 0 for one without tiles.
int64_t getBlockThreads(mlir::Operation *kernel);
/// Runs `work` on the kernel of a module, with the threads of a block; a kernel
/// without tiles stays as it is.
mlir::LogicalResult forTileKernel(
    mlir::ModuleOp module,
    llvm::function_ref<mlir::LogicalResult(mlir::FunctionOpInterface, int64_t)>
        work);
/// An operation on tiles, rather than one that passes them on.
bool computesTiles(mlir::Operation *op);
inline TileType tileType(mlir::Value value) {
  return mlir::cast<TileType>(value.getType());
}
inline bool isTile(mlir::Value value) {
  return mlir::isa<TileType>(value.getType());
}
bool isInline(mlir::Operation *op);
/// How the operation of a use reads its elements.
TileRead getRead(mlir::OpOperand &use);
/// The same of an access: picked indices are read by all threads that have
/// elements of the row.
TileRead getAccessRead(TileAccessOp access, mlir::OpOperand &use);
/// The layout of the tiles that an operation gives.
TileLayoutAttr getLayout(mlir::Operation *op);
inline TileLayoutAttr getLayout(mlir::OpState op) {
  return getLayout(op.getOperation());
}
/// That of a tile: packed in memory if it is an argument of a block.
TileLayoutAttr getLayout(mlir::Value tile);
void setLayout(mlir::Operation *op, TileLayoutAttr layout);
/// The number that ends the name of an operation's function (TileFunction).
int64_t getDeviceVariant(mlir::Operation *op);
/// Operations that read the memory of a tile, also through views and tiles that
/// are computed where they are used.
llvm::SetVector<mlir::Operation *> getReaders(mlir::Value tile);
/// Zero of a type that tiles, or threads, have values of; of an array none.
mlir::Value makeZero(mlir::OpBuilder &b, mlir::Location loc, mlir::Type type);
/// True if the kernel, or that of an operation, calls functions of the device
/// library for whole tiles: on a CPU, where a block is one thread.
bool callsForTiles(mlir::Operation *op, int64_t threads);
int64_t getTileBytes(TileType type);
/// The place of each component that a thread has in a tile whose last index is
/// the thread's: all indices but that one.
llvm::SmallVector<llvm::SmallVector<int64_t>> componentsOf(TileType type);
/// Elements from row to row of a matrix, if that is not its width.
std::optional<int64_t> getPitch(mlir::Value tile);
/// With what is between rows, and of all stages of a tile that is loaded ahead.
int64_t getStagedBytes(mlir::Value tile);

/// True if threads have the elements of a tile that they treat in registers.
bool isDistributed(mlir::Value tile);
/// True if every thread has the one element of such a tile.
bool isReplicated(mlir::Value tile);

/// A tile that lies in memory, and from one element to the next along each of
/// its dimensions, in elements.
struct Strided {
  mlir::Value memory;
  llvm::SmallVector<int64_t> steps;
};
/// None for what is computed where it is used, but for transposed memory, and
/// for reshaped memory without gaps.
std::optional<Strided> getStrided(mlir::Value tile);

/// Tiles in memory, in classes that share it: what loops and branches carry,
/// and what is changed in place.
class TileBuffers {
public:
  explicit TileBuffers(mlir::FunctionOpInterface kernel);
  /// The tile that stands for its class.
  mlir::Value rootOf(mlir::Value tile) const;
  llvm::ArrayRef<mlir::Value> getTiles() const { return tiles; }
  /// The offset of a tile in shared memory, in bytes, once that is planned.
  int64_t getOffset(mlir::Value tile) const {
    return offsetOf.lookup(rootOf(tile));
  }
  /// True if a tile is in registers and has no memory.
  bool isInRegisters(mlir::Value tile) const {
    return inRegisters.contains(rootOf(tile));
  }

private:
  void tie(mlir::Value a, mlir::Value b);
  void tieRegions(mlir::Operation *op);
  void readOffsets(mlir::Operation *op);

  llvm::EquivalenceClasses<void *> classes;
  llvm::SmallVector<mlir::Value> tiles;
  llvm::DenseMap<mlir::Value, int64_t> offsetOf;
  llvm::DenseSet<mlir::Value> inRegisters;
};

} // namespace warp::tiles

#endif // WARP_TRANSFORMS_TILES_TILEBUFFERS_H

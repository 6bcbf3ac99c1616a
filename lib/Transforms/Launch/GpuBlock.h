//===- GpuBlock.h - Threads and memory of a GPU block -----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_GPUBLOCK_H
#define WARP_LIB_TRANSFORMS_GPUBLOCK_H

#include "mlir/IR/Builders.h"
#include "mlir/IR/BuiltinOps.h"

namespace warp {

constexpr int64_t warpSize = 32;
/// Address space of the memory that the threads of a block share.
constexpr unsigned sharedSpace = 3;

mlir::Value callIntrinsic(mlir::OpBuilder &b, mlir::Location loc,
                          mlir::Type type, llvm::StringRef name,
                          mlir::ValueRange operands);

/// A value of 32 or 64 bits of another lane: `mode` is one of PTX's shfl.sync
/// and says which lane `lane` means. All lanes of the warp must get here.
mlir::Value shuffle(mlir::OpBuilder &b, mlir::Location loc,
                    llvm::StringRef mode, mlir::Value value, mlir::Value lane);

/// A special register: `tid.x`, `ntid.y`.
mlir::Value readSpecial(mlir::OpBuilder &b, mlir::Location loc,
                        llvm::StringRef name);

/// Number of the thread in its block, which has any number of axes.
mlir::Value threadInBlock(mlir::OpBuilder &b, mlir::Location loc);

/// What all lanes of the warp have together; all of them must get here, and get
/// it.
mlir::Value
overLanes(mlir::OpBuilder &b, mlir::Location loc, mlir::Value value,
          llvm::function_ref<mlir::Value(mlir::Value, mlir::Value)> combine);

/// Waits for all threads of the block.
void synchronizeBlock(mlir::OpBuilder &b, mlir::Location loc);

/// Address of new shared memory, a variable whose name begins with `name`.
mlir::Value makeShared(mlir::OpBuilder &b, mlir::Location loc,
                       mlir::ModuleOp module, mlir::Type type,
                       llvm::StringRef name);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_GPUBLOCK_H

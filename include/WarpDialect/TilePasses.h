//===- TilePasses.h - Passes about tiles ------------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARPDIALECT_TILEPASSES_H
#define WARPDIALECT_TILEPASSES_H

#include "mlir/Pass/Pass.h"

namespace mlir {
class DialectRegistry;
} // namespace mlir

namespace warp {

namespace tiles {
/// Attaches the models of tile operations to the dialect.
void registerModels(mlir::DialectRegistry &registry);
} // namespace tiles

namespace attr {
/// On a kernel with tiles: threads of the blocks that it is written for.
constexpr llvm::StringLiteral blockThreads = "warp.block_threads";
/// On such a kernel: blocks are threads that follow each other in the launch,
/// whatever its extents, and the last block may lack some.
constexpr llvm::StringLiteral ragged = "warp.ragged";
/// On a branch of such a kernel, one side of which returns: "then" or "else",
/// the side of the threads that stay.
constexpr llvm::StringLiteral stays = "warp.stays";
/// On such a kernel, from warp-plan-tile-memory on: bytes of shared memory.
constexpr llvm::StringLiteral blockBytes = "warp.block_bytes";
/// On one whose threads hold tiles: blocks that a multiprocessor of a GPU is to
/// have room for, which limits registers.
constexpr llvm::StringLiteral leastBlocks = "warp.least_blocks";
} // namespace attr

/// Shared memory of a GPU block without an opt-in.
constexpr int64_t staticBlockBytes = 48 << 10;
/// The bytes that launches of a kernel have to ask for.
int64_t getDynamicBytes(mlir::Operation *kernel);

#define GEN_PASS_DECL
#include "WarpDialect/TilePasses.h.inc"

#define GEN_PASS_REGISTRATION
#include "WarpDialect/TilePasses.h.inc"

} // namespace warp

#endif // WARPDIALECT_TILEPASSES_H

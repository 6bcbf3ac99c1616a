//===- LaunchShapes.h - Block sizes of library kernels ----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Constants that the kernels of this folder share with their launches in
// lib/Runtime/cuda: threads of a block, and how much a block does.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_CUDA_LAUNCHSHAPES_H
#define WARP_DEVICELIB_CUDA_LAUNCHSHAPES_H

/// Fill.cpp. A thread writes 16 bytes in each round.
namespace fillShape {
constexpr int threads = 256, rounds = 4, mostRegions = 64;
constexpr int runBytes = threads * rounds * 16;
} // namespace fillShape

/// Scan.cpp. A thread moves 16 bytes in each round.
namespace scanShape {
constexpr int threads = 256, rounds = 8;
constexpr int threadBytes = rounds * 16;
} // namespace scanShape

/// SparseProduct.cpp. The length of the sequence by thread is odd, so that
/// neighbours use different banks.
namespace productShape {
constexpr int threads = 256, perThread = 7;
constexpr int tileLength = threads * perThread;
} // namespace productShape

/// Tree*.cpp.
namespace treeShape {
/// Threads of kernels for centers and keys, halves, blocks, and the top.
constexpr int threads = 256, halvers = 1024, fillers = 512, toppers = 1024;
/// Places of what one block halves, as many for each thread; a greater segment
/// has a bin for each thread.
constexpr int each = 4, chunk = halvers * each, bins = halvers;
/// Words of bounds, of which six are used.
constexpr int boundsWords = 8;
/// Words before the counts of digits: bounds, wrong faces, skipped.
constexpr int wrongAt = 6, skippedAt = 7, headWords = 8;
} // namespace treeShape

#endif // WARP_DEVICELIB_CUDA_LAUNCHSHAPES_H

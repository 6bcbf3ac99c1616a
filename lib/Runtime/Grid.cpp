//===- Grid.cpp - GPU grids of launches -----------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Maps the extents of a launch to a grid, as its code's schedule asks. The last
// dimension lies on the x axis, the one before on y, the product of the rest on
// z. Blocks are shaped to the launch: wide in x, where memory is contiguous,
// and no wider than the launch is. Their extents are powers of two, or, where
// that would leave threads without an index, whole rows of the launch. Nothing
// here asks a driver.
//
//===----------------------------------------------------------------------===//

#include "Grid.h"

#include "Support.h"

#include <algorithm>

using namespace warp;

static int64_t powerAtLeast(int64_t value) {
  int64_t power = 1;
  while (power < value)
    power *= 2;
  return power;
}

/// The product of the first extents.
static int64_t product(const LaunchDim &dim, int count) {
  int64_t product = 1;
  for (int i = 0; i < count; ++i)
    product *= dim.extent[i];
  return product;
}

/// Extents that are left if threads take several indices and blocks are merged.
/// A thread takes `rowCoarsening` indices of the dimension before the last, and
/// the others of the first.
static LaunchDim coarsened(const Schedule &schedule, LaunchDim dim) {
  if (schedule.blockCoarsening > 1)
    dim.extent[dim.rank - 2] /= schedule.blockCoarsening;
  dim.extent[0] =
      ceilDivide(dim.extent[0], schedule.coarsening / schedule.rowCoarsening);
  if (schedule.rowCoarsening > 1)
    dim.extent[dim.rank - 2] =
        ceilDivide(dim.extent[dim.rank - 2], schedule.rowCoarsening);
  return dim;
}

int64_t warp::coarsenedThreads(const Schedule &schedule, const LaunchDim &dim) {
  return product(coarsened(schedule, dim), dim.rank);
}

/// A square tile of indices of the last two dimensions for each block, all
/// along one axis.
static Grid tiledGrid(const LaunchDim &dim, int64_t side, int64_t blockDim) {
  int64_t tiles = ceilDivide(dim.extent[dim.rank - 1], side) *
                  ceilDivide(dim.extent[dim.rank - 2], side);
  return {{product(dim, dim.rank - 2) * tiles}, {side, blockDim / side}};
}

/// A block of a grid with an axis for each dimension.
static Extent shapeBlock(const Extent &all, int64_t blockDim,
                         bool severalIndices, const DeviceLimits &limits) {
  Extent block;
  // A few rows per block where there are rows, for the sake of neighbours;
  // fewer where a thread has neighbours of its own.
  int64_t rows = std::min<int64_t>(
      {severalIndices ? 4 : 8, powerAtLeast(all.y), blockDim});
  block.x = std::min<int64_t>(std::max<int64_t>(1, blockDim / rows),
                              powerAtLeast(all.x));
  block.y = std::min<int64_t>(blockDim / block.x, powerAtLeast(all.y));
  block.z = std::min<int64_t>(
      {blockDim / (block.x * block.y), powerAtLeast(all.z), limits.blockZ});
  // Blocks are full even where the launch is small: kernels that combine
  // values over a block count on its warps.
  block.x = std::max<int64_t>(block.x, blockDim / (block.y * block.z));
  return block;
}

/// Threads of warps that a launch takes by blocks of a shape.
static int64_t threadsOfWarps(const Extent &all, const Extent &block) {
  constexpr int64_t warp = 32;
  int64_t blocks = ceilDivide(all.x, block.x) * ceilDivide(all.y, block.y) *
                   ceilDivide(all.z, block.z);
  return blocks * ceilDivide(block.count(), warp) * warp;
}

/// A block of whole rows, or whole planes, that has at most so many threads:
/// those of a warp follow each other in the launch. As many of them as leave
/// the fewest threads idle.
static Extent rowsOfBlock(const Extent &all, int64_t blockDim,
                          const DeviceLimits &limits) {
  bool byPlanes = all.x * all.y * 2 <= blockDim && all.z > 1;
  int64_t inner = byPlanes ? all.x * all.y : all.x;
  int64_t most = std::min<int64_t>({blockDim / inner, byPlanes ? all.z : all.y,
                                    byPlanes ? limits.blockZ : blockDim});
  Extent best;
  for (int64_t count = most; count >= std::max<int64_t>(1, most / 2); --count) {
    Extent block =
        byPlanes ? Extent{all.x, all.y, count} : Extent{all.x, count, 1};
    if (count == most || threadsOfWarps(all, block) < threadsOfWarps(all, best))
      best = block;
  }
  return best;
}

Grid warp::gridFor(const Schedule &schedule, const LaunchDim &dim, int blockDim,
                   bool flat, const DeviceLimits &limits) {
  if (schedule.singleBlock)
    return {{}, {schedule.singleBlock}};
  if (schedule.transposeTile)
    return tiledGrid(dim, schedule.transposeTile, blockDim);
  LaunchDim left = coarsened(schedule, dim);
  int64_t threads = blockDim / schedule.splitReduction;
  Grid grid;
  if (flat || schedule.cooperative || dim.rank == 1) {
    grid = {{ceilDivide(product(left, dim.rank), threads)}, {threads}};
  } else {
    Extent all{left.extent[dim.rank - 1], left.extent[dim.rank - 2],
               product(left, dim.rank - 2)};
    grid.block = shapeBlock(all, threads, schedule.coarsening > 1, limits);
    bool canTakeRows = !schedule.fixedBlock && schedule.coarsening == 1 &&
                       schedule.splitReduction == 1 && all.count() > threads &&
                       all.x <= threads;
    if (canTakeRows) {
      Extent rows = rowsOfBlock(all, threads, limits);
      // An eighth fewer threads outweigh rows of 32.
      if (8 * threadsOfWarps(all, rows) <= 7 * threadsOfWarps(all, grid.block))
        grid.block = rows;
    }
    grid.blocks = {ceilDivide(all.x, grid.block.x),
                   ceilDivide(all.y, grid.block.y),
                   ceilDivide(all.z, grid.block.z)};
  }
  grid.block.y *= schedule.splitReduction;
  return grid;
}

bool warp::fitsGrid(const LaunchDim &dim, int blockDim) {
  return dim.rank == 1 ||
         (dim.rank <= 3 && gridFor({}, dim, blockDim, /*flat=*/false).fits({}));
}

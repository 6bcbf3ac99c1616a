//===- TileBuilder.h - Builder of tile operations ---------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The part of `Builder` for kernels with tiles, in a header of its own.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TILEBUILDER_H
#define WARP_TILEBUILDER_H

#include "warp/Builder.h"

namespace warp {

/// How an operation on tiles is meant; each uses some of it.
struct TileOptions {
  /// How elements are combined: add, min, max, assign, ...
  std::string kind;
  /// Shape and element type of the result.
  std::vector<int64_t> shape;
  Type element;
  /// Steps of a slice, dimensions of a transposition.
  std::vector<int64_t> axes;
  std::optional<int64_t> axis;
  /// Accesses may be outside of the array.
  bool checked = true;
  /// Unit attributes of the operation's record that are set, by name.
  std::vector<std::string> flags;
  /// The last operand is the tile of indices that an access picks, or the
  /// condition of a set.
  bool picked = false, where = false;
  /// The part of an element: names of fields, and "1" or "2" for as many
  /// indices, which come after those of the element.
  std::vector<std::string> path;
};

/// Builds operations on tiles where a `Builder` stands.
class WARP_API TileBuilder {
public:
  explicit TileBuilder(Builder &builder);

  using Values = Builder::Values;
  /// The operation `warp.tile_<name>`; BuilderTiles.cpp says which operands
  /// each takes. Returns its results.
  Values make(const std::string &name, const Values &operands,
              const TileOptions &options);
  /// Opens a function of elements, and returns one of each operand; with `fold`
  /// what earlier elements of the only operand gave, and the next one.
  Values beginFunction(const Values &operands, bool fold);
  /// Closes it; returns a tile per element that it gives, or what it folds to.
  Values endFunction(const Values &elements, const TileOptions &options);
  /// Lets the threads of a block wait for each other.
  void addBarrier();
  /// Says for blocks of how many threads the kernel is. Ragged ones are threads
  /// that follow each other in the launch, whatever its extents; else they are
  /// rows of its last dimension.
  void setBlockThreads(int64_t threads, bool ragged = false);
  /// Says of the branch that is open that threads which do not take the first
  /// side (`isElse`), or the second, return from the kernel: it is what those
  /// do that stay.
  void markStays(bool isElse);

private:
  Builder::Impl &impl;
};

/// Indices of its thread that a kernel with factorisations or substitutions of
/// small tiles asks for, if one warp is enough for its blocks and its results
/// do not depend on how many threads they have; 0 otherwise. Launches with more
/// dimensions than that may have blocks of a warp.
WARP_API int rankOfWarpBlocks(const Module &module);

} // namespace warp

#endif // WARP_TILEBUILDER_H

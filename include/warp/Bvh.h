//===- Bvh.h - Bounding volume hierarchies ----------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A hierarchy over boxes, which kernels search by its `id`. It has bounds of
// its own: the arrays it was made from are read when it is made and refitted.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_BVH_H
#define WARP_BVH_H

#include "warp/Export.h"
#include "warp/Handle.h"
#include "warp/Launch.h"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

namespace warp {

/// How primitives are split: by the surface area heuristic, or in the middle.
/// None: they are not, and what is searched is given by `adopt`.
enum class BvhConstructor { Sah, Median, None };

/// The primitives of a hierarchy.
struct BvhReport {
  /// Boxes that are NaN or inverted, and faces that are NaN or infinite; they
  /// are never found.
  int64_t skipped = 0;
  int64_t nodes = 0, blocks = 0, bytes = 0;
  int depth = 0;
};

/// The addresses of a hierarchy on its device, for kernels that refit it.
struct HierarchyView {
  uint64_t nodes = 0, blocks = 0;
  int64_t blockCount = 0;
  /// From the user's coordinates to those of the hierarchy.
  float scale = 1;
  /// Nodes by their levels, and where each level starts, and the last one ends.
  std::vector<int32_t> order, levels;
};

/// The addresses of a hierarchy that the caller has built on its device: nodes
/// and blocks, and the numbers of groups with the nodes that hold them, or 0.
struct BuiltTree {
  uint64_t nodes, blocks;
  size_t nodeBytes, blockBytes;
  uint64_t groups;
};

class WARP_API Bvh {
public:
  /// Arrays of the lower and upper corners of boxes, of three floats each, and
  /// of a number for each box, which may be empty.
  Bvh(const ArrayDescriptor &lowers, const ArrayDescriptor &uppers, int device,
      BvhConstructor constructor = BvhConstructor::Sah,
      const ArrayDescriptor &groups = {});
  ~Bvh();

  uint64_t id() const;
  /// Takes over moved boxes; which of them are neighbours stays.
  void refit(const ArrayDescriptor &lowers, const ArrayDescriptor &uppers);
  void rebuild(const ArrayDescriptor &lowers, const ArrayDescriptor &uppers,
               BvhConstructor constructor = BvhConstructor::Sah,
               const ArrayDescriptor &groups = {});
  /// Searches nodes and blocks that the caller builds and keeps, where the
  /// device reads them; it also writes the scale and the number of groups into
  /// the slot.
  void adopt(const BuiltTree &built);
  BvhReport report() const;
  HierarchyView view() const;

private:
  struct Impl;
  /// Shared with graphs that update it.
  std::shared_ptr<Impl> impl;
};

} // namespace warp

#endif // WARP_BVH_H

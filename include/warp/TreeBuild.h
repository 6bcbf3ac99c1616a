//===- TreeBuild.h - BVH construction on devices ----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The shape of such a hierarchy follows from its number of primitives: eight
// that are neighbours in an order share a block, eight blocks a node, eight
// nodes the next one. Building finds the order, by halves or along a curve.
// Everything is queued on a stream, temporary memory included: graphs capture
// it.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TREEBUILD_H
#define WARP_TREEBUILD_H

#include "warp/Device.h"
#include "warp/Export.h"
#include "warp/Memory.h"

#include <cstdint>
#include <utility>
#include <vector>

namespace warp {

/// Numbers of nodes on the levels, the root first, and of blocks.
struct TreeShape {
  static constexpr int64_t nodeBytes = 256;
  static constexpr int64_t blockBytes(bool ofTriangles) {
    return ofTriangles ? 320 : 224;
  }

  WARP_API explicit TreeShape(int64_t count);
  int64_t nodes() const;

  std::vector<int64_t> levels;
  int64_t blocks;
};

inline int64_t TreeShape::nodes() const {
  int64_t sum = 0;
  for (int64_t number : levels)
    sum += number;
  return sum;
}

/// The results of a build, which the host knows before it ends.
class TreeFindings {
public:
  WARP_API explicit TreeFindings(int device);
  /// Waits for the first face with a wrong index, or how many there are, and
  /// how many primitives are never found.
  WARP_API std::pair<int, int> wait() const;

  int32_t *memory() const { return static_cast<int32_t *>(numbers.data()); }
  const Event &event() const { return done; }

private:
  Buffer numbers;
  Event done;
};

struct TreeBuild {
  /// Points, of three floats each, or lower corners of boxes; packed.
  const void *first;
  int64_t points;
  /// Three corners of each triangle, or upper corners of boxes; packed.
  const void *second;
  int32_t count;
  bool ofTriangles;
  /// True if neighbours are those along a Hilbert curve: quicker to build and
  /// slower to search.
  bool alongCurve;
  void *nodes, *blocks;
  /// Gets the scale of coordinates.
  float *scale;
  /// Gets the first face with a wrong index, or `count`, and how many
  /// primitives are never found.
  int32_t *found;
  /// Gets the same, if there is one; not while a graph is captured.
  const TreeFindings *findings = nullptr;
};

/// CUDA only.
WARP_API void buildTree(int device, const TreeBuild &build,
                        const Stream *stream = nullptr);
/// Takes over primitives that moved, at the scale that is there; which of them
/// are neighbours stays, and `found`.
WARP_API void refitTree(int device, const TreeBuild &build,
                        const Stream *stream = nullptr);

} // namespace warp

#endif // WARP_TREEBUILD_H

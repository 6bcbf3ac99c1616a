//===- TreeBuild.cpp - BVH builds on CUDA ---------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Launches of lib/DeviceLib/cuda/Tree*.cpp, whose parameters are repeated here.
//
//===----------------------------------------------------------------------===//

#include "warp/TreeBuild.h"

#include "DeviceLib/cuda/LaunchShapes.h"
#include "LibraryKernels.h"

#include <algorithm>
#include <string_view>
#include <vector>

using namespace warp;
using namespace treeShape;

namespace {
constexpr int64_t mostBlocks = 1056;
/// Above this number the curve goes through 1024 cells along each axis, and
/// not through 256.
constexpr int64_t few = 1 << 20;

struct Quad {
  float at[4];
};

struct Primitives {
  const void *first, *second;
  int64_t points;
  int32_t count, ofTriangles;
};
struct Levels {
  int32_t count, starts[13], blocks;
};
struct Halving {
  const Quad *from;
  Quad *to;
  const uint32_t *bounds;
  uint32_t *halves, *counts, *states;
  int32_t count, size;
};

/// Parts of one piece of memory.
class Parts {
public:
  template <class T> size_t add(int64_t count, size_t alignment = 256) {
    size_t at = (bytes + alignment - 1) / alignment * alignment;
    bytes = at + count * sizeof(T);
    return at;
  }
  size_t bytes = 0;
};

/// Segments of one size, all of which are halved.
struct Step {
  int64_t size;
  size_t boundsAt, countsAt, statesAt;
};

/// A build while its work is queued.
class Building {
public:
  Building(int device, const TreeBuild &build, const Stream *stream);

  void run();
  /// Writes nodes and blocks; those keep what they have if nothing is ordered.
  void fill(const QueuedWork &work);

private:
  LibraryKernel kernel(const char *name) const;
  template <class T> T *at(size_t offset) const {
    return reinterpret_cast<T *>(memory + offset);
  }
  void see(const QueuedWork &work);
  void sort(const QueuedWork &work);
  void halve(const QueuedWork &work);

  int device;
  const TreeBuild &build;
  const Stream *stream;
  TreeShape shape;
  Primitives primitives;
  /// Bits of each coordinate; numbers along the curve have three times as many.
  int bits;
  std::vector<Step> steps;
  size_t headAt, lastBoundsAt, centersAt, otherAt, orderAt;
  Parts parts;
  char *memory = nullptr;
  /// Primitives as they are ordered by now.
  const int32_t *ordered = nullptr;
};
} // namespace

Building::Building(int device, const TreeBuild &build, const Stream *stream)
    : device(device), build(build), stream(stream), shape(build.count),
      primitives{build.first, build.second, build.points, build.count,
                 build.ofTriangles},
      bits(build.count > few ? 10 : 8) {
  int64_t count = build.count;
  headAt = parts.add<uint32_t>(headWords);
  if (build.alongCurve) {
    SortState sort(device, {NumberType::UInt32, nullptr, nullptr, 4, count}, 0,
                   3 * bits);
    parts.add<uint32_t>(sort.words(), 1);
  } else {
    int64_t size = chunk;
    while (size < count)
      size *= 2;
    // The root's bounds are in the head.
    size_t bounds = headAt;
    for (; size > chunk; size /= 2) {
      int64_t segments = ceilDivide(count, size);
      size_t countsAt = parts.add<uint32_t>(segments * bins);
      size_t statesAt = parts.add<uint32_t>(1 + ceilDivide(count, chunk));
      steps.push_back({size, bounds, countsAt, statesAt});
      bounds = parts.add<uint32_t>(2 * segments * boundsWords);
    }
    lastBoundsAt = bounds;
  }
  centersAt = parts.add<Quad>(count);
  // Keys and their room, or centers.
  otherAt = parts.add<Quad>(count);
  orderAt = parts.add<int32_t>(2 * count);
}

LibraryKernel Building::kernel(const char *name) const {
  std::string_view text = name;
  const char *code =
      text == "tree_fill" || text == "tree_top" ? "TreeFill"
      : text == "tree_count" || text == "tree_part" || text == "tree_halve"
          ? "TreeHalves"
          : "TreeOrder";
  return kernelOf(device, code, name);
}

void Building::see(const QueuedWork &work) {
  int64_t blocks = std::min(mostBlocks, ceilDivide(build.count, threads));
  launchKernel(work, kernel("tree_see"), blocks, 1, threads, primitives,
               at<Quad>(centersAt), at<uint32_t>(headAt));
  const TreeFindings *findings = build.findings;
  launchKernel(work, kernel("tree_report"), 1, 1, 32, at<uint32_t>(headAt),
               build.count, build.scale, build.found,
               findings ? findings->memory() : nullptr);
  if (findings)
    WARP_CUDA(eventRecord,
              static_cast<cuda::EventHandle>(findings->event().handle()),
              work.stream());
}

void Building::sort(const QueuedWork &work) {
  int64_t blocks = std::min(mostBlocks, ceilDivide(build.count, threads));
  auto *head = at<uint32_t>(headAt);
  auto *keys = at<uint32_t>(otherAt);
  auto *order = at<int32_t>(orderAt);
  launchKernel(work, kernel("tree_key"), blocks, 1, threads,
               at<Quad>(centersAt), build.count, bits, keys, order, head);
  SortState sort(device, {NumberType::UInt32, keys, order, 4, build.count}, 0,
                 3 * bits);
  bool isBehind = sort.move(work, head + headWords);
  ordered = order + (isBehind ? build.count : 0);
}

void Building::halve(const QueuedWork &work) {
  int64_t chunks = ceilDivide(build.count, chunk);
  Quad *from = at<Quad>(centersAt), *to = at<Quad>(otherAt);
  for (size_t i = 0; i < steps.size(); ++i) {
    const Step &step = steps[i];
    // Nobody asks for the bounds of the last halves.
    size_t halvesAt =
        i + 1 < steps.size() ? steps[i + 1].boundsAt : lastBoundsAt;
    Halving halving{from,
                    to,
                    at<uint32_t>(step.boundsAt),
                    at<uint32_t>(halvesAt),
                    at<uint32_t>(step.countsAt),
                    at<uint32_t>(step.statesAt),
                    build.count,
                    int32_t(step.size)};
    launchKernel(work, kernel("tree_count"), chunks, 1, halvers, halving);
    launchKernel(work, kernel("tree_part"), chunks, 1, halvers, halving);
    std::swap(from, to);
  }
  auto *order = at<int32_t>(orderAt);
  launchKernel(work, kernel("tree_halve"), chunks, 1, halvers, from, order,
               build.count);
  ordered = order;
}

void Building::run() {
  Buffer buffer(device, parts.bytes, false, stream);
  memory = static_cast<char *>(buffer.data());
  setMemory(memory + headAt, device, 0, centersAt - headAt, stream);
  QueuedWork work(device, stream);
  see(work);
  if (build.alongCurve)
    sort(work);
  else
    halve(work);
  fill(work);
}

void Building::fill(const QueuedWork &work) {
  Levels levels{int32_t(shape.levels.size()), {}, int32_t(shape.blocks)};
  for (size_t i = 0; i < shape.levels.size(); ++i)
    levels.starts[i + 1] = int32_t(levels.starts[i] + shape.levels[i]);
  launchKernel(work, kernel("tree_fill"), ceilDivide(build.count, fillers), 1,
               fillers, primitives, ordered,
               static_cast<const float *>(build.scale), levels, build.nodes,
               build.blocks);
  if (levels.count > 2)
    launchKernel(work, kernel("tree_top"), 1, 1, toppers, levels, build.nodes);
}

void CudaDevice::buildTree(const TreeBuild &build, bool refits,
                           const Stream *stream) {
  if (!refits)
    return Building(index, build, stream).run();
  QueuedWork work(index, stream);
  Building(index, build, stream).fill(work);
}

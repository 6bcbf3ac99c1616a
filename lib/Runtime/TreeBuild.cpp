//===- TreeBuild.cpp - Hierarchies that a GPU builds ----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Launches of lib/DeviceLib/cuda/TreeOrder.cpp and TreeFill.cpp, whose
// constants and parameters are repeated here.
//
//===----------------------------------------------------------------------===//

#include "warp/TreeBuild.h"

#include "CudaKernels.h"
#include "GraphTrace.h"

#include <algorithm>
#include <vector>

using namespace warp;

extern "C" const char warp_cuda_TreeOrder_begin[], warp_cuda_TreeFill_begin[];

namespace {
constexpr int threads = 256, halvers = 1024, fillers = 512;
constexpr int64_t mostBlocks = 1056;
/// Elements of a run, of what a block halves, and runs in that.
constexpr int64_t run = 128, chunk = 4096, runsInChunk = 32;
/// Nodes of one level and blocks have so many children.
constexpr int64_t width = 8;
constexpr int64_t headWords = 8;
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
  const Quad *centers;
  const int32_t *order, *coarse;
  int32_t *out;
  int32_t elements, stop, incomplete;
};

/// Parts of one piece of memory.
class Parts {
public:
  template <class T> size_t add(int64_t count) {
    size_t at = (bytes + alignment - 1) / alignment * alignment;
    bytes = at + count * sizeof(T);
    return at;
  }
  size_t bytes = 0;

private:
  static constexpr size_t alignment = 256;
};

/// Elements that are halved: primitives, or runs of elements.
struct Step {
  int64_t elements;
  /// Primitives of an element.
  int64_t size;
  size_t centersAt, orderAt;
};

/// A build while its work is queued.
class Building {
public:
  Building(int device, const TreeBuild &build, const Stream *stream);

  void run();
  /// Writes nodes and blocks; those keep what they have if nothing is ordered.
  void fill(const QueuedWork &work);

private:
  cuda::Function order(const char *name) const {
    return kernelOf(device, warp_cuda_TreeOrder_begin, name);
  }
  template <class T> T *at(size_t offset) const {
    return reinterpret_cast<T *>(memory + offset);
  }
  void sort(const QueuedWork &work);
  void halve(const QueuedWork &work);

  int device;
  const TreeBuild &build;
  const Stream *stream;
  TreeShape shape;
  Primitives primitives;
  /// Of the numbers along the curve, three times as many.
  int bits;
  std::vector<Step> steps;
  size_t headAt, keysAt, orderAt;
  Parts parts;
  char *memory = nullptr;
  /// Primitives as they are ordered by now.
  const int32_t *ordered = nullptr;
};
} // namespace

TreeShape::TreeShape(int64_t count) : blocks(ceilDivide(count, width)) {
  if (count == 0)
    return;
  levels = {ceilDivide(blocks, width)};
  while (levels.front() > 1)
    levels.insert(levels.begin(), ceilDivide(levels.front(), width));
}

Building::Building(int device, const TreeBuild &build, const Stream *stream)
    : device(device), build(build), stream(stream), shape(build.count),
      primitives{build.first, build.second, build.points, build.count,
                 build.ofTriangles},
      bits(build.count > few ? 10 : 8) {
  int64_t count = build.count;
  SortState sort({NumberType::UInt32, nullptr, nullptr, 4, count}, 0, 3 * bits);
  headAt = parts.add<uint32_t>(headWords + sort.words());
  keysAt = parts.add<uint32_t>(2 * count);
  orderAt = parts.add<int32_t>(2 * count);
  // Keys are done with when primitives are halved.
  steps = {{count, 1, parts.add<Quad>(count), keysAt}};
  while (!build.alongCurve && steps.back().elements > chunk) {
    int64_t elements = ceilDivide(steps.back().elements, ::run);
    steps.push_back({elements, steps.back().size * ::run,
                     parts.add<Quad>(elements), parts.add<int32_t>(elements)});
  }
}

void Building::sort(const QueuedWork &work) {
  int64_t blocks = std::min(mostBlocks, ceilDivide(build.count, threads));
  auto *head = at<uint32_t>(headAt);
  auto *centers = at<Quad>(steps[0].centersAt);
  auto *keys = at<uint32_t>(keysAt);
  auto *order = at<int32_t>(orderAt);
  launchKernel(work, this->order("tree_see"), blocks, 1, threads, primitives,
               centers, head);
  launchKernel(work, this->order("tree_key"), blocks, 1, threads, centers,
               build.count, bits, keys, order, head, build.scale, build.found);
  SortState sort({NumberType::UInt32, keys, order, 4, build.count}, 0,
                 3 * bits);
  bool isBehind = sort.move(work, device, head + headWords);
  ordered = order + (isBehind ? build.count : 0);
}

void Building::halve(const QueuedWork &work) {
  for (size_t i = 1; i < steps.size(); ++i)
    launchKernel(work, order("tree_runs"),
                 ceilDivide(steps[i].elements, threads / 32), 1, threads,
                 at<Quad>(steps[i - 1].centersAt), i == 1 ? ordered : nullptr,
                 int32_t(steps[i - 1].elements), at<Quad>(steps[i].centersAt));
  const int32_t *coarse = nullptr;
  for (size_t i = steps.size(); i-- > 0;) {
    const Step &step = steps[i];
    auto *out = at<int32_t>(step.orderAt);
    Halving halving{at<Quad>(step.centersAt),
                    i == 0 ? ordered : nullptr,
                    coarse,
                    out,
                    int32_t(step.elements),
                    int32_t(i == 0 ? width : runsInChunk),
                    build.count % step.size != 0};
    launchKernel(work, order("tree_halve"), ceilDivide(step.elements, chunk), 1,
                 halvers, halving);
    coarse = out;
  }
  ordered = coarse;
}

void Building::run() {
  Buffer buffer(device, parts.bytes, false, stream);
  memory = static_cast<char *>(buffer.data());
  setMemory(memory + headAt, device, 0, keysAt - headAt, stream);
  QueuedWork work(device, stream);
  sort(work);
  if (!build.alongCurve)
    halve(work);
  fill(work);
}

void Building::fill(const QueuedWork &work) {
  Levels levels{int32_t(shape.levels.size()), {}, int32_t(shape.blocks)};
  for (size_t i = 0; i < shape.levels.size(); ++i)
    levels.starts[i + 1] = int32_t(levels.starts[i] + shape.levels[i]);
  auto kernel = [&](const char *name) {
    return kernelOf(device, warp_cuda_TreeFill_begin, name);
  };
  launchKernel(work, kernel("tree_fill"), ceilDivide(build.count, fillers), 1,
               fillers, primitives, ordered,
               static_cast<const float *>(build.scale), levels, build.nodes,
               build.blocks);
  if (levels.count > 2)
    launchKernel(work, kernel("tree_top"), 1, 1, 1024, levels, build.nodes);
}

static void note(GraphTrace &trace, const TreeBuild &build, bool refits) {
  trace.add(GraphOperation::Kind::BuildTree,
            graphs::BuildTree{build.first, build.second, build.nodes,
                              build.blocks, build.scale, build.found,
                              build.points, build.count, build.ofTriangles,
                              build.alongCurve, refits});
}

void warp::buildTree(int device, const TreeBuild &build, const Stream *stream) {
  if (build.count == 0)
    return;
  TraceScope tracing(device, stream);
  if (tracing)
    note(*tracing.operator->(), build, false);
  Building(device, build, stream).run();
}

void warp::refitTree(int device, const TreeBuild &build, const Stream *stream) {
  if (build.count == 0)
    return;
  TraceScope tracing(device, stream);
  if (tracing)
    note(*tracing.operator->(), build, true);
  QueuedWork work(device, stream);
  Building(device, build, stream).fill(work);
}

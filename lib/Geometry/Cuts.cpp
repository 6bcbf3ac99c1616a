//===- Cuts.cpp - Binned splits of BVH builds -----------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Cuts.h"

#include "warp/ThreadPool.h"

#include <algorithm>
#include <memory>
#include <numeric>

using namespace warp;
using namespace warp::geometry;

namespace {

constexpr int mostBins = 16;
/// Primitives that a thread sweeps at a time, and at most so many times.
constexpr int64_t leastChunk = 4096, mostChunks = 64;

/// Twice the centroid of a box in the lanes of the lows and, negated, of the
/// highs.
Floats centroidOf(Floats box) {
  Floats low = __builtin_shufflevector(box, box, 0, 1, 2, 3, 4, 5, 6, 7);
  Floats high = __builtin_shufflevector(box, box, 3, 4, 5, 0, 1, 2, 6, 7);
  return low - high;
}

/// The places of the bins of centroids.
struct Grid {
  Floats low, scale;
  int bins;

  Grid(const Range &range) : low(range.centroids), scale(0) {
    bins = range.size() < 32 ? mostBins / 2 : mostBins;
    for (int axis = 0; axis < 3; ++axis) {
      float size = float(bins) / (-low[3 + axis] - low[axis]);
      scale[axis] = size < infinity ? size : 0;
    }
  }
  bool isWide(int axis) const { return scale[axis] > 0; }
  Floats placeOf(Floats centroid) const { return (centroid - low) * scale; }
  Ints binsOf(Floats centroid) const {
    Floats place = least(placeOf(centroid), Floats(float(bins - 1)));
    return __builtin_convertvector(place, Ints);
  }
};

/// Boxes and numbers of the primitives in bins.
struct Bins {
  Floats box[3][mostBins];
  int32_t count[3][mostBins];

  void clear(int bins) {
    for (int axis = 0; axis < 3; ++axis) {
      std::fill_n(box[axis], bins, Floats(infinity));
      std::fill_n(count[axis], bins, 0);
    }
  }
  void include(const BuildPrimitive *first, int64_t size, const Grid &grid) {
    for (int64_t i = 0; i < size; ++i) {
      Floats it = boxOf(first[i]);
      Ints bin = grid.binsOf(centroidOf(it));
      for (int axis = 0; axis < 3; ++axis) {
        box[axis][bin[axis]] = least(box[axis][bin[axis]], it);
        ++count[axis][bin[axis]];
      }
    }
  }
  void include(const Bins &other, int bins) {
    for (int axis = 0; axis < 3; ++axis)
      for (int bin = 0; bin < bins; ++bin) {
        box[axis][bin] = least(box[axis][bin], other.box[axis][bin]);
        count[axis][bin] += other.count[axis][bin];
      }
  }
};

/// Primitives whose bin along `axis` is below `bin`.
struct Cut {
  int axis = -1, bin = 0;
  /// How many they are.
  int32_t below = 0;
  float cost = infinity;
};

} // namespace

Range warp::geometry::makeRange(const Sorted &all, int64_t begin, int64_t end) {
  Range range{begin, end};
  for (int64_t i = begin; i < end; ++i) {
    Floats box = boxOf(all.primitives[i]);
    range.box = least(range.box, box);
    range.centroids = least(range.centroids, centroidOf(box));
  }
  return range;
}

/// The cost of searching boxes: their surface times their blocks.
static float costOf(Floats box, int32_t count) {
  Floats size =
      -__builtin_shufflevector(box, box, 3, 4, 5, 3, 4, 5, 6, 7) - box;
  float area = size[0] * size[1] + size[1] * size[2] + size[2] * size[0];
  return area * float((count + width - 1) / width);
}

static Cut findCut(const Bins &in, const Grid &grid) {
  Cut best;
  for (int axis = 0; axis < 3; ++axis) {
    if (!grid.isWide(axis))
      continue;
    float cost[mostBins];
    Floats box = Floats(infinity);
    int32_t number = 0;
    for (int bin = grid.bins - 1; bin > 0; --bin) {
      box = least(box, in.box[axis][bin]);
      number += in.count[axis][bin];
      cost[bin] = number ? costOf(box, number) : infinity;
    }
    box = Floats(infinity);
    number = 0;
    for (int bin = 1; bin < grid.bins; ++bin) {
      box = least(box, in.box[axis][bin - 1]);
      number += in.count[axis][bin - 1];
      float sum = number ? costOf(box, number) + cost[bin] : infinity;
      if (sum < best.cost)
        best = {axis, bin, number, sum};
    }
  }
  return best;
}

/// Copies what is below a cut to `below` and what is above to `above`. One of
/// them may be where they come from, as it is never ahead of that.
static void part(const BuildPrimitive *first, int64_t size, const Grid &grid,
                 const Cut &cut, BuildPrimitive *below, BuildPrimitive *above) {
  const int axis = cut.axis;
  float from = grid.low[axis], scale = grid.scale[axis];
  auto bin = float(cut.bin);
  for (int64_t i = 0; i < size; ++i) {
    const BuildPrimitive it = first[i];
    float at = it.bounds.low[axis] + it.bounds.high[axis];
    bool isBelow = (at - from) * scale < bin;
    *(isBelow ? below : above) = it;
    below += isBelow;
    above += !isBelow;
  }
}

static std::pair<Range, Range> halve(const Range &range, const Bins &bins,
                                     const Grid &grid, const Cut &cut) {
  int64_t middle = range.begin + cut.below;
  Range low{range.begin, middle}, high{middle, range.end};
  const Floats *boxes = bins.box[cut.axis];
  for (int bin = 0; bin < grid.bins; ++bin) {
    Floats &box = bin < cut.bin ? low.box : high.box;
    box = least(box, boxes[bin]);
  }
  low.centroids = greatest(range.centroids, low.box + low.box);
  high.centroids = greatest(range.centroids, high.box + high.box);
  return {low, high};
}

namespace {

/// A range in chunks, for several threads.
class ChunkedCut {
public:
  ChunkedCut(Sorted &all, const Range &range, const Grid &grid)
      : first(all.primitives.data() + range.begin),
        spare(all.spare.data() + range.begin), range(range), grid(grid),
        chunk(
            std::max(leastChunk, (range.size() + mostChunks - 1) / mostChunks)),
        chunks((range.size() + chunk - 1) / chunk) {}

  bool run(std::pair<Range, Range> &halves) {
    std::unique_ptr<Bins[]> bins(new Bins[chunks]);
    forChunks([&](int64_t i, const BuildPrimitive *from, int64_t size) {
      bins[i].clear(grid.bins);
      bins[i].include(from, size, grid);
    });
    Bins sum = bins[0];
    for (int64_t i = 1; i < chunks; ++i)
      sum.include(bins[i], grid.bins);
    Cut cut = findCut(sum, grid);
    if (cut.axis < 0)
      return false;
    // Destinations of each chunk's primitives: below from the front, above
    // behind all that are below.
    int64_t below[mostChunks + 1] = {}, above[mostChunks + 1] = {};
    for (int64_t i = 0; i < chunks; ++i) {
      const int32_t *count = bins[i].count[cut.axis];
      int64_t size = std::min(chunk, range.size() - i * chunk);
      below[i + 1] = std::accumulate(count, count + cut.bin, below[i]);
      above[i + 1] = above[i] + size - (below[i + 1] - below[i]);
    }
    forChunks([&](int64_t i, const BuildPrimitive *from, int64_t size) {
      part(from, size, grid, cut, spare + below[i],
           spare + below[chunks] + above[i]);
    });
    forChunks([&](int64_t i, const BuildPrimitive *, int64_t size) {
      std::copy_n(spare + i * chunk, size, first + i * chunk);
    });
    halves = halve(range, sum, grid, cut);
    return true;
  }

private:
  template <class Fn> void forChunks(Fn &&fn) {
    ThreadPool::parallelFor(0, chunks, 1, [&](int64_t from, int64_t to) {
      for (int64_t i = from; i < to; ++i)
        fn(i, first + i * chunk, std::min(chunk, range.size() - i * chunk));
    });
  }

  BuildPrimitive *first, *spare;
  const Range &range;
  const Grid &grid;
  int64_t chunk, chunks;
};

} // namespace

bool warp::geometry::cutByArea(Sorted &all, const Range &range,
                               std::pair<Range, Range> &halves) {
  Grid grid(range);
  if (range.size() > 2 * leastChunk)
    return ChunkedCut(all, range, grid).run(halves);
  BuildPrimitive *first = all.primitives.data() + range.begin;
  BuildPrimitive *spare = all.spare.data() + range.begin;
  Bins bins;
  bins.clear(grid.bins);
  bins.include(first, range.size(), grid);
  Cut cut = findCut(bins, grid);
  if (cut.axis < 0)
    return false;
  part(first, range.size(), grid, cut, first, spare);
  std::copy_n(spare, range.size() - cut.below, first + cut.below);
  halves = halve(range, bins, grid, cut);
  return true;
}

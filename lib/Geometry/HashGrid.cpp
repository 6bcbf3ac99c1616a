//===- HashGrid.cpp - Hash grids: neighbour search of points --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The points are sorted by the number of their cell, stably and by as many
// digits as the number of cells has; where the points of a cell begin is read
// off the sorted numbers. Points that are NaN sort behind the last cell.
//
//===----------------------------------------------------------------------===//

#include "warp/HashGrid.h"

#include "DeviceTree.h"
#include "Recording.h"

#include <bit>

using namespace warp;
using namespace warp::geometry;

namespace {

/// The words after the first in the slot of a grid. Python's kernel language
/// reads the same bytes (python/warp/_src/geometry/grid_queries.py).
struct GridSlot {
  int32_t cells[3];
  int32_t points;
  /// Cells per unit of length, as wide as the points say.
  double inverse;
  ArrayDescriptor starts, order;
  /// A number for each point, or empty; the caller's.
  ArrayDescriptor groups;
};
static_assert(sizeof(uint64_t) + sizeof(GridSlot) <= slotSize);

/// A point on the way through the sort.
struct Entry {
  uint32_t cell;
  int32_t point;
};

constexpr int cellDigitBits = 11;
constexpr int64_t pointsPerChunk = 4096;

} // namespace

/// The cell of a coordinate before it is wrapped, as a kernel's `int(floor(x))`
/// has it; false for NaN. Without a call: processors of any age run this code.
template <class F> static bool cellOf(F scaled, int32_t &cell) {
  if (scaled >= F(-2147483648.0) && scaled < F(2147483648.0)) {
    auto towardsZero = int32_t(scaled);
    cell = towardsZero - (F(towardsZero) > scaled);
    return true;
  }
  cell = scaled > 0 ? INT32_MAX : INT32_MIN;
  return scaled == scaled;
}

static int32_t wrap(int32_t cell, int32_t count) {
  if (uint32_t(cell) < uint32_t(count))
    return cell;
  int32_t rest = cell % count;
  return rest < 0 ? rest + count : rest;
}

static float halfToFloat(uint16_t bits) {
  return float(std::bit_cast<_Float16>(bits));
}

struct HashGrid::Impl {
  explicit Impl(const int32_t (&counts)[3]);

  void reserve(int64_t points);
  void build(const ArrayDescriptor &points, int scalarSize, double width,
             const ArrayDescriptor &groupArray);
  template <class Read>
  void assign(const ArrayDescriptor &points, double inverse, Read &&read);
  template <class T, class F>
  void assignAs(const ArrayDescriptor &points, double width);
  void sort(int64_t count);
  void sortByDigit(int64_t count, int shift, int bits);
  void findStarts(int64_t count);
  void publish(int64_t count, double inverse);

  Slot slot;
  int32_t cells[3];
  int64_t total;
  std::vector<Entry> entries, sorted;
  std::vector<int32_t> starts, order;
  ArrayDescriptor groups;
  int64_t skipped = 0;
};

HashGrid::Impl::Impl(const int32_t (&counts)[3])
    : slot(GeometryKind::HashGrid, cpuDevice) {
  total = 1;
  for (int i = 0; i < 3; ++i) {
    if (counts[i] <= 0)
      throw Error(Error::Kind::Runtime,
                  "a HashGrid has at least one cell along each axis");
    cells[i] = counts[i];
    total *= counts[i];
    if (total > INT32_MAX)
      throw Error(Error::Kind::Runtime, "a HashGrid has fewer than 2^31 cells");
  }
  starts.assign(total + 1, 0);
  publish(0, 1);
}

void HashGrid::Impl::reserve(int64_t points) {
  entries.reserve(points);
  sorted.reserve(points);
  order.reserve(points);
}

/// Gives every point its cell.
template <class Read>
void HashGrid::Impl::assign(const ArrayDescriptor &points, double inverse,
                            Read &&read) {
  int64_t count = points.shape[0];
  entries.resize(count);
  sorted.resize(count);
  order.resize(count);
  ThreadPool::parallelFor(
      0, count, pointsPerChunk, [&](int64_t from, int64_t to) {
        for (int64_t i = from; i < to; ++i) {
          int32_t at[3];
          bool isNumber = true;
          for (int axis = 0; axis < 3; ++axis)
            isNumber &= cellOf(read(i, axis), at[axis]);
          int64_t cell = wrap(at[2], cells[2]);
          cell = cell * cells[1] + wrap(at[1], cells[1]);
          cell = cell * cells[0] + wrap(at[0], cells[0]);
          entries[i] = {uint32_t(isNumber ? cell : total), int32_t(i)};
        }
      });
  sort(count);
  publish(count, inverse);
}

/// Points of `T`, of which cells are found in `F`.
template <class T, class F>
void HashGrid::Impl::assignAs(const ArrayDescriptor &points, double width) {
  struct Three {
    T at[3];
  };
  HostElements<Three> elements(points, slot.device());
  F inverse = F(1) / F(width);
  assign(points, inverse, [&](int64_t i, int axis) {
    if constexpr (sizeof(T) == 2)
      return halfToFloat(elements[i].at[axis]) * inverse;
    else
      return elements[i].at[axis] * inverse;
  });
}

/// One pass of a stable radix sort; the result is in `entries` again.
void HashGrid::Impl::sortByDigit(int64_t count, int shift, int bits) {
  int64_t chunks =
      std::clamp<int64_t>(count / pointsPerChunk, 1, 4 * ThreadPool::size());
  size_t digits = size_t(1) << bits;
  uint32_t mask = uint32_t(digits - 1);
  std::vector<int32_t> places(chunks * digits);
  auto eachChunk = [&](auto &&body) {
    ThreadPool::parallelFor(0, chunks, 1, [&](int64_t from, int64_t to) {
      for (int64_t chunk = from; chunk < to; ++chunk)
        body(&places[chunk * digits], count * chunk / chunks,
             count * (chunk + 1) / chunks);
    });
  };
  eachChunk([&](int32_t *place, int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i)
      ++place[entries[i].cell >> shift & mask];
  });
  int32_t sum = 0;
  for (size_t digit = 0; digit < digits; ++digit)
    for (int64_t chunk = 0; chunk < chunks; ++chunk) {
      int32_t &place = places[chunk * digits + digit];
      int32_t number = place;
      place = sum;
      sum += number;
    }
  eachChunk([&](int32_t *place, int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i)
      sorted[place[entries[i].cell >> shift & mask]++] = entries[i];
  });
  entries.swap(sorted);
}

void HashGrid::Impl::sort(int64_t count) {
  int bits = std::bit_width(uint64_t(total));
  int passes = (bits + cellDigitBits - 1) / cellDigitBits;
  int each = (bits + passes - 1) / passes;
  for (int pass = 0; pass < passes; ++pass)
    sortByDigit(count, pass * each, each);
  findStarts(count);
}

/// Each entry fills the starts of the cells since the one before it.
void HashGrid::Impl::findStarts(int64_t count) {
  auto cellAt = [&](int64_t i) {
    return i < 0 ? int64_t(-1) : i < count ? int64_t(entries[i].cell) : total;
  };
  int64_t ranges = std::clamp<int64_t>(total / 65536, 1, 64);
  ThreadPool::parallelFor(0, ranges, 1, [&](int64_t from, int64_t to) {
    int64_t firstCell = (total + 1) * from / ranges;
    int64_t endCell = (total + 1) * to / ranges;
    auto entry = std::lower_bound(
        entries.begin(), entries.begin() + count, firstCell,
        [](const Entry &a, int64_t cell) { return int64_t(a.cell) < cell; });
    int64_t i = entry - entries.begin();
    int64_t cell = firstCell;
    for (; cell < endCell; ++i) {
      int64_t next = std::min(cellAt(i) + 1, endCell);
      if (next <= cell)
        continue;
      std::fill(starts.begin() + cell, starts.begin() + next, int32_t(i));
      cell = next;
    }
  });
  ThreadPool::parallelFor(0, count, pointsPerChunk,
                          [&](int64_t from, int64_t to) {
                            for (int64_t i = from; i < to; ++i)
                              order[i] = entries[i].point;
                          });
  skipped = count - starts[total];
}

void HashGrid::Impl::build(const ArrayDescriptor &points, int scalarSize,
                           double width, const ArrayDescriptor &groupArray) {
  groups = groupArray;
  if (scalarSize == 8)
    return assignAs<double, double>(points, width);
  if (scalarSize == 2)
    return assignAs<uint16_t, float>(points, width);
  assignAs<float, float>(points, width);
}

void HashGrid::Impl::publish(int64_t count, double inverse) {
  GridSlot contents{};
  std::copy_n(cells, 3, contents.cells);
  contents.points = int32_t(count);
  contents.inverse = inverse;
  auto describe = [&](std::vector<int32_t> &host) {
    ArrayDescriptor array;
    array.ndim = 1;
    array.shape[0] = int32_t(host.size());
    array.strides[0] = sizeof(int32_t);
    array.data = host.data();
    return array;
  };
  contents.starts = describe(starts);
  contents.order = describe(order);
  contents.groups = groups;
  slot.write(&contents, sizeof contents);
}

HashGrid::HashGrid(const int32_t (&cells)[3])
    : impl(std::make_shared<Impl>(cells)) {}

HashGrid::~HashGrid() = default;

uint64_t HashGrid::id() const { return impl->slot.id(); }

void HashGrid::build(const ArrayDescriptor &points, int scalarSize,
                     double width, const ArrayDescriptor &groups) {
  graphs::UpdateGeometry note = noteOf(impl->slot, {points, groups});
  note.width = width;
  note.scalarSize = scalarSize;
  update(impl->slot, note, [impl = impl, points, scalarSize, width, groups] {
    impl->build(points, scalarSize, width, groups);
  });
}

void HashGrid::reserve(int64_t points) { impl->reserve(points); }

int64_t HashGrid::skipped() const { return impl->skipped; }

//===- RegionFormula.cpp - From a launch to what it touches ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Asked at each launch that a tape records, so nothing is allocated but what
// is returned. Indices become progressions, accesses boxes of those, and boxes
// of one array that continue each other become one, before strides make blocks
// of memory of them.
//
//===----------------------------------------------------------------------===//

#include "warp/Compile.h"
#include "warp/Kernel.h"
#include "warp/Regions.h"

#include <algorithm>
#include <cstring>
#include <numeric>
#include <optional>

using namespace warp;

using Op = RegionFormula::Op;
using Node = RegionFormula::Node;

/// Boxes of one array; more become their hull.
static constexpr int mostBoxes = 8;

//===----------------------------------------------------------------------===//
// Integers
//===----------------------------------------------------------------------===//

static int64_t wrap(int64_t value, unsigned bits, bool isSigned) {
  if (bits >= 64)
    return value;
  unsigned shift = 64 - bits;
  auto moved = static_cast<uint64_t>(value) << shift;
  return isSigned ? static_cast<int64_t>(moved) >> shift
                  : static_cast<int64_t>(moved >> shift);
}

/// Kernels give 0 for a zero divisor, and the smallest number by -1 wraps.
static int64_t divide(Op op, int64_t a, int64_t b) {
  if (b == 0)
    return 0;
  if (b == -1)
    return op == Op::Mod ? 0 : static_cast<int64_t>(0 - uint64_t(a));
  if (op == Op::Mod)
    return a % b;
  return a / b - (op == Op::FloorDiv && a % b != 0 && (a < 0) != (b < 0));
}

static int64_t combine(const Node &node, int64_t a, int64_t b) {
  auto x = static_cast<uint64_t>(a), y = static_cast<uint64_t>(b);
  switch (node.op) {
  case Op::Add:
    return static_cast<int64_t>(x + y);
  case Op::Sub:
    return static_cast<int64_t>(x - y);
  case Op::Mul:
    return static_cast<int64_t>(x * y);
  case Op::Div:
  case Op::FloorDiv:
  case Op::Mod:
    return divide(node.op, a, b);
  case Op::Min:
    return std::min(a, b);
  case Op::Max:
    return std::max(a, b);
  case Op::And:
    return a & b;
  case Op::Or:
    return a | b;
  case Op::Xor:
    return a ^ b;
  case Op::ShiftLeft:
    return y < node.bits ? static_cast<int64_t>(x << y) : 0;
  case Op::ShiftRight:
    return a >> std::min<uint64_t>(y, 63);
  default:
    return a;
  }
}

namespace {

/// What the nodes of a formula are at a launch.
class Values {
public:
  Values(const RegionFormula &formula, const LaunchDim &dim,
         const void *params);
  int64_t operator[](int32_t node) const { return data[node]; }

private:
  int64_t evaluate(const Node &node, const LaunchDim &dim,
                   const char *params) const;

  int64_t local[64];
  std::vector<int64_t> more;
  int64_t *data = local;
};

} // namespace

static int64_t readInteger(const char *from, const Node &node) {
  uint64_t value = 0;
  std::memcpy(&value, from, node.bits / 8);
  return static_cast<int64_t>(value);
}

int64_t Values::evaluate(const Node &node, const LaunchDim &dim,
                         const char *params) const {
  switch (node.op) {
  case Op::Constant:
    return node.a;
  case Op::Extent:
    return node.a < dim.rank ? dim.extent[node.a] : 1;
  case Op::Argument:
    return readInteger(params + node.a, node);
  case Op::ArrayExtent: {
    int32_t extent;
    std::memcpy(&extent,
                params + node.a + offsetof(ArrayDescriptor, shape) +
                    node.b * sizeof(extent),
                sizeof(extent));
    return extent;
  }
  case Op::Cast:
    return data[node.a];
  default:
    return combine(node, data[node.a], data[node.b]);
  }
}

Values::Values(const RegionFormula &formula, const LaunchDim &dim,
               const void *params) {
  size_t count = formula.nodes.size();
  if (count > std::size(local)) {
    more.resize(count);
    data = more.data();
  }
  auto *bytes = static_cast<const char *>(params);
  for (size_t i = 0; i < count; ++i) {
    const Node &node = formula.nodes[i];
    data[i] = wrap(evaluate(node, dim, bytes), node.bits, node.isSigned);
  }
}

//===----------------------------------------------------------------------===//
// Indices
//===----------------------------------------------------------------------===//

namespace {

/// Indices start, start + step, ..., last.
struct Span {
  int64_t start = 0, last = 0, step = 1;

  bool operator==(const Span &other) const {
    return start == other.start && last == other.last && step == other.step;
  }
  bool has(const Span &other) const {
    return start <= other.start && other.last <= last &&
           (step == 1 || ((other.start - start) % step == 0 &&
                          (other.step % step == 0 || other.isOne())));
  }
  bool isOne() const { return start == last; }
};

struct Box {
  Span dims[maxRank];
};

} // namespace

/// The values of an index, none if no thread has one; the whole dimension if
/// they are not known.
static std::optional<Span> spanOf(const RegionFormula::Index &index,
                                  const Values &values, int64_t extent) {
  Span whole{0, extent - 1, 1};
  if (index.base < 0)
    return whole;
  Span span{values[index.base], values[index.base], 0};
  for (const RegionFormula::Symbol &symbol : index.symbols) {
    int64_t count = values[symbol.count], reach;
    if (count <= 0)
      return std::nullopt;
    if (__builtin_mul_overflow(values[symbol.factor], count - 1, &reach))
      return whole;
    int64_t &end = reach < 0 ? span.start : span.last;
    if (__builtin_add_overflow(end, reach, &end))
      return whole;
    if (reach)
      span.step = std::gcd(span.step, std::abs(values[symbol.factor]));
  }
  span.step = std::max<int64_t>(span.step, 1);
  return span;
}

/// Cuts off what is outside of [0, extent); false if nothing is left.
static bool clip(Span &span, int64_t extent) {
  if (span.start < 0)
    span.start += (-span.start + span.step - 1) / span.step * span.step;
  if (span.last >= extent && span.start < extent)
    span.last = span.start + (extent - 1 - span.start) / span.step * span.step;
  return span.start <= span.last && span.start < extent;
}

/// The elements that an index may stand for: those from the beginning and those
/// that are counted from the end.
static int placesOf(const RegionFormula::Index &index, const Values &values,
                    int64_t extent, Span *places) {
  std::optional<Span> span = spanOf(index, values, extent);
  if (!span)
    return 0;
  int count = 0;
  Span plain = *span;
  if (clip(plain, extent))
    places[count++] = plain;
  if (span->start < 0 && index.mayWrap) {
    Span wrapped = *span;
    if (wrapped.last >= 0)
      wrapped.last =
          wrapped.start + (-1 - wrapped.start) / wrapped.step * wrapped.step;
    wrapped.start += extent;
    wrapped.last += extent;
    if (clip(wrapped, extent))
      places[count++] = wrapped;
  }
  return count;
}

//===----------------------------------------------------------------------===//
// Boxes
//===----------------------------------------------------------------------===//

namespace {

/// Boxes of one array that one kind of access touches.
class Boxes {
public:
  explicit Boxes(int rank) : rank(rank) {}

  void add(Box box);
  int size() const { return count; }
  const Box &operator[](int i) const { return boxes[i]; }

private:
  bool join(Box &into, const Box &other) const;

  int rank, count = 0;
  Box boxes[mostBoxes + 1];
};

} // namespace

static Span hullOf(const Span &a, const Span &b) {
  return {std::min(a.start, b.start), std::max(a.last, b.last),
          std::max<int64_t>(1, std::gcd(std::gcd(a.isOne() ? 0 : a.step,
                                                 b.isOne() ? 0 : b.step),
                                        std::abs(a.start - b.start)))};
}

/// Whether the hull of two spans has no element that neither has.
static bool isTight(const Span &a, const Span &b, const Span &hull) {
  if (hull == a || hull == b)
    return true;
  // Others may fill the gap between two elements.
  if (a.isOne() && b.isOne())
    return hull.step == 1;
  if ((!a.isOne() && a.step != hull.step) ||
      (!b.isOne() && b.step != hull.step))
    return false;
  return a.start <= b.last + hull.step && b.start <= a.last + hull.step;
}

/// Makes one box of two if that adds nothing.
bool Boxes::join(Box &into, const Box &other) const {
  int different = -1;
  bool holds = true, isHeld = true;
  for (int i = 0; i < rank; ++i) {
    holds &= into.dims[i].has(other.dims[i]);
    isHeld &= other.dims[i].has(into.dims[i]);
    if (!(into.dims[i] == other.dims[i]))
      different = different < 0 ? i : maxRank;
  }
  if (holds)
    return true;
  if (isHeld) {
    into = other;
    return true;
  }
  if (different < 0 || different == maxRank)
    return false;
  Span &span = into.dims[different];
  Span hull = hullOf(span, other.dims[different]);
  if (!isTight(span, other.dims[different], hull))
    return false;
  span = hull;
  return true;
}

void Boxes::add(Box box) {
  for (int i = 0; i < count;) {
    if (!join(box, boxes[i])) {
      ++i;
      continue;
    }
    boxes[i] = boxes[--count];
    i = 0;
  }
  boxes[count++] = box;
  if (count <= mostBoxes)
    return;
  for (; count > 1; --count)
    for (int i = 0; i < rank; ++i)
      boxes[0].dims[i] = hullOf(boxes[0].dims[i], boxes[count - 1].dims[i]);
}

static void addBoxes(const RegionFormula::Access &access, const Values &values,
                     const ArrayDescriptor &array, Boxes &boxes) {
  Span places[maxRank][2];
  int counts[maxRank];
  int total = 1;
  for (int i = 0; i < array.ndim; ++i) {
    static const RegionFormula::Index any;
    const auto &index =
        size_t(i) < access.indices.size() ? access.indices[i] : any;
    counts[i] = placesOf(index, values, array.shape[i], places[i]);
    total *= counts[i];
  }
  for (int number = 0; number < total; ++number) {
    Box box;
    for (int i = 0, rest = number; i < array.ndim; ++i) {
      box.dims[i] = places[i][rest % counts[i]];
      rest /= counts[i];
    }
    boxes.add(box);
  }
}

static MemoryBlock blockOf(const Box &box, ArrayDescriptor array,
                           int64_t itemSize) {
  auto *data = static_cast<char *>(array.data);
  int64_t steps[maxRank];
  for (int i = 0; i < array.ndim; ++i) {
    const Span &span = box.dims[i];
    steps[i] = span.step;
    array.shape[i] =
        static_cast<int32_t>((span.last - span.start) / span.step + 1);
    data += span.start * array.strides[i];
    if (array.strides[i] < 0)
      data += (span.last - span.start) * array.strides[i];
  }
  MemoryBlock block;
  block.start = reinterpret_cast<uint64_t>(data);
  block.item = itemSize;
  // Insertion by stride.
  for (int i = 0; i < array.ndim; ++i) {
    int64_t stride = std::abs(int64_t(array.strides[i]));
    if (array.shape[i] < 2 || !stride)
      continue;
    int place = block.rank++;
    for (; place > 0 && block.dims[place - 1].stride < stride; --place)
      block.dims[place] = block.dims[place - 1];
    block.dims[place] = {stride, steps[i], array.shape[i]};
  }
  return block;
}

//===----------------------------------------------------------------------===//
// Launches
//===----------------------------------------------------------------------===//

/// What a kernel does with one array, as a region.
static Region regionOf(const RegionFormula &formula, const Values &values,
                       int32_t number, const ArrayDescriptor &array,
                       int64_t itemSize, bool written) {
  Boxes boxes(array.ndim);
  for (const RegionFormula::Access &access : formula.accesses)
    if (access.array == number && (written ? access.writes : access.reads))
      addBoxes(access, values, array, boxes);
  Region region;
  region.blocks.reserve(boxes.size());
  for (int i = 0; i < boxes.size(); ++i)
    region.blocks.push_back(blockOf(boxes[i], array, itemSize));
  return region;
}

void warp::findRegions(const RegionFormula &formula,
                       const std::vector<Access> &accesses,
                       const LaunchDim &dim, const void *params,
                       std::vector<ArrayRegions> &regions) {
  Values values(formula, dim, params);
  regions.resize(accesses.size());
  for (size_t i = 0; i < accesses.size(); ++i) {
    const Access &access = accesses[i];
    ArrayDescriptor array;
    std::memcpy(&array, static_cast<const char *>(params) + access.offset,
                sizeof(array));
    auto *extents = array.shape;
    if (!array.data || std::count(extents, extents + array.ndim, 0))
      continue;
    auto number = static_cast<int32_t>(i);
    bool reads = access.loaded || access.fetched;
    bool writes = access.stored || access.combined;
    if (i >= formula.unknown.size() || formula.unknown[i]) {
      MemoryBlock whole = blockOf(array, access.elementSize);
      if (reads)
        regions[i].read.blocks.push_back(whole);
      if (writes)
        regions[i].written.blocks.push_back(whole);
      continue;
    }
    if (reads)
      regions[i].read =
          regionOf(formula, values, number, array, access.elementSize, false);
    if (writes)
      regions[i].written =
          regionOf(formula, values, number, array, access.elementSize, true);
  }
}

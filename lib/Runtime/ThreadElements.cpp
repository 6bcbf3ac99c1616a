//===- ThreadElements.cpp - Elements that one thread touches --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Two accesses to one array meet in an element of different threads unless
// some of their indices are the same function of the thread in both, and these
// together tell threads apart: x[i, k] and x[i, 0] do for threads i, whatever k
// is. An index of several thread dimensions tells them apart if each factor
// exceeds the reach of all smaller ones, like digits of a number.
//
// Rows of launches that have the first extent in common meet in no element if
// some index has the same factor of the row in both, and that is larger than
// all else in which the two may differ.
//
//===----------------------------------------------------------------------===//

#include "ThreadElements.h"

#include "Overlap.h"
#include "RegionValues.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>

using namespace warp;

using Index = ThreadAccess::Index;

//===----------------------------------------------------------------------===//
// Accesses
//===----------------------------------------------------------------------===//

/// False if no thread makes the access.
static bool evaluate(const RegionFormula &formula,
                     const RegionFormula::Index &index,
                     const RegionValues &values, const LaunchDim &dim,
                     Index &result) {
  if (index.base < 0)
    return true;
  result.base = values[index.base];
  result.isKnown = true;
  int64_t least = result.base;
  for (const RegionFormula::Symbol &symbol : index.symbols) {
    int64_t count = values[symbol.count], factor = values[symbol.factor];
    if (count <= 0)
      return false;
    const RegionFormula::Node &node = formula.nodes[symbol.count];
    // Nothing else is counted by an extent of the launch.
    if (node.op == RegionFormula::Op::Extent && node.a < dim.rank)
      result.factors[node.a] += factor;
    else if (count > 1)
      result.isKnown = false;
    int64_t reach;
    if (__builtin_mul_overflow(factor, count - 1, &reach) ||
        __builtin_add_overflow(least, std::min<int64_t>(reach, 0), &least))
      result.isKnown = false;
  }
  // Counted from the end, an element has two indices.
  result.isKnown &= least >= 0;
  return true;
}

static std::string nameAt(const std::vector<Param> &params, int64_t offset) {
  for (const Param &param : params)
    if (param.offset <= offset && offset < param.offset + param.size)
      return param.name;
  return "?";
}

std::vector<ThreadAccess> warp::threadAccesses(const Kernel &kernel,
                                               const LaunchDim &dim,
                                               const void *params) {
  const RegionFormula &formula = kernel.regionFormula();
  const std::vector<Access> &arrays = kernel.arrayAccesses();
  RegionValues values(formula, dim, params);
  std::vector<ThreadAccess> found;
  auto start = [&](size_t number) {
    const Access &array = arrays[number];
    ThreadAccess access;
    std::memcpy(&access.array, static_cast<const char *>(params) + array.offset,
                sizeof(access.array));
    access.elementSize = array.elementSize;
    access.name = nameAt(kernel.parameters(), array.offset);
    return access;
  };
  auto isUnknown = [&](size_t number) {
    return number >= formula.unknown.size() || formula.unknown[number];
  };
  for (size_t i = 0; i < arrays.size(); ++i) {
    if (!isUnknown(i))
      continue;
    ThreadAccess access = start(i);
    access.writes = arrays[i].stored || arrays[i].combined;
    if (access.writes || arrays[i].loaded)
      found.push_back(std::move(access));
  }
  for (const RegionFormula::Access &known : formula.accesses) {
    if (isUnknown(known.array))
      continue;
    ThreadAccess access = start(known.array);
    access.writes = known.writes;
    bool happens = true;
    size_t rank = std::min<size_t>(known.indices.size(), access.array.ndim);
    for (size_t i = 0; i < rank && happens; ++i)
      happens =
          evaluate(formula, known.indices[i], values, dim, access.indices[i]);
    if (happens)
      found.push_back(std::move(access));
  }
  return found;
}

//===----------------------------------------------------------------------===//
// Pairs
//===----------------------------------------------------------------------===//

/// True if the elements of an array lie apart, and so each has one index.
static bool liesApart(const ArrayDescriptor &array, int64_t elementSize) {
  std::vector<std::pair<int64_t, int64_t>> dims;
  for (int i = 0; i < array.ndim; ++i)
    if (array.shape[i] > 1)
      dims.push_back({std::abs(int64_t(array.strides[i])), array.shape[i]});
  std::sort(dims.begin(), dims.end());
  int64_t reach = elementSize;
  for (auto [stride, extent] : dims) {
    if (stride < reach)
      return false;
    reach += stride * (extent - 1);
  }
  return true;
}

static bool isSameArray(const ArrayDescriptor &a, const ArrayDescriptor &b) {
  return a.data == b.data && a.ndim == b.ndim &&
         std::equal(a.shape, a.shape + a.ndim, b.shape) &&
         std::equal(a.strides, a.strides + a.ndim, b.strides);
}

/// Adds the thread dimensions that an index tells apart.
static void addTold(const Index &index, const LaunchDim &dim, unsigned &told) {
  std::vector<std::pair<int64_t, int>> factors;
  for (int i = 0; i < dim.rank; ++i)
    if (dim.extent[i] > 1 && index.factors[i])
      factors.push_back({std::abs(index.factors[i]), i});
  std::sort(factors.begin(), factors.end());
  int64_t reach = 0;
  unsigned all = 0;
  for (auto [factor, i] : factors) {
    if (factor <= reach)
      return;
    reach += factor * (dim.extent[i] - 1);
    all |= 1u << i;
  }
  told |= all;
}

static bool meet(const ThreadAccess &a, const ThreadAccess &b) {
  return rangeOf(a.array.data, a.array, a.elementSize, 1)
      .overlaps(rangeOf(b.array.data, b.array, b.elementSize, 1));
}

/// True if threads may share an element.
static bool cross(const ThreadAccess &a, const ThreadAccess &b,
                  const LaunchDim &dim) {
  if (!meet(a, b))
    return false;
  if (a.elementSize != b.elementSize || !isSameArray(a.array, b.array) ||
      !liesApart(a.array, a.elementSize))
    return true;
  unsigned told = 0;
  for (int i = 0; i < a.array.ndim; ++i)
    if (a.indices[i].isKnown && a.indices[i] == b.indices[i])
      addTold(a.indices[i], dim, told);
  for (int i = 0; i < dim.rank; ++i)
    if (dim.extent[i] > 1 && !(told >> i & 1))
      return true;
  return false;
}

std::optional<std::string>
warp::findCrossing(const std::vector<ThreadAccess> &first,
                   const std::vector<ThreadAccess> &second,
                   const LaunchDim &dim) {
  for (const ThreadAccess &b : second)
    for (const ThreadAccess &a : first)
      if ((a.writes || b.writes) && cross(a, b, dim))
        return b.name;
  return std::nullopt;
}

//===----------------------------------------------------------------------===//
// Rows
//===----------------------------------------------------------------------===//

/// How far the indices behind the first one change an index, to either side.
struct Reach {
  int64_t below = 0, above = 0;
};

/// Nothing if a reach overflows 64 bits.
static std::optional<Reach> reachOf(const Index &index, const LaunchDim &dim) {
  Reach reach;
  for (int i = 1; i < dim.rank; ++i) {
    int64_t change;
    if (__builtin_mul_overflow(index.factors[i], dim.extent[i] - 1, &change))
      return std::nullopt;
    int64_t &side = change < 0 ? reach.below : reach.above;
    if (__builtin_add_overflow(side, std::abs(change), &side))
      return std::nullopt;
  }
  return reach;
}

/// True if equal values of two indices are of the same row.
static bool tellsRows(const Index &a, const LaunchDim &dim, const Index &b,
                      const LaunchDim &otherDim) {
  if (!a.isKnown || !b.isKnown || a.factors[0] != b.factors[0] ||
      a.factors[0] == 0)
    return false;
  std::optional<Reach> first = reachOf(a, dim), second = reachOf(b, otherDim);
  if (!first || !second)
    return false;
  // The other terms differ by so much if the two indices are equal.
  __int128 distance = __int128(b.base) - a.base;
  __int128 least = distance - second->below - first->above;
  __int128 most = distance + second->above + first->below;
  __int128 row = std::abs(a.factors[0]);
  return -row < least && most < row;
}

static bool crossRows(const ThreadAccess &a, const LaunchDim &dim,
                      const ThreadAccess &b, const LaunchDim &otherDim) {
  if (!meet(a, b))
    return false;
  if (a.elementSize != b.elementSize || !isSameArray(a.array, b.array) ||
      !liesApart(a.array, a.elementSize))
    return true;
  for (int i = 0; i < a.array.ndim; ++i)
    if (tellsRows(a.indices[i], dim, b.indices[i], otherDim))
      return false;
  return dim.extent[0] > 1;
}

std::optional<std::string> warp::findRowCrossing(
    const std::vector<ThreadAccess> &first, const LaunchDim &dim,
    const std::vector<ThreadAccess> &second, const LaunchDim &otherDim) {
  for (const ThreadAccess &b : second)
    for (const ThreadAccess &a : first)
      if ((a.writes || b.writes) && crossRows(a, dim, b, otherDim))
        return b.name;
  return std::nullopt;
}

bool warp::mayMeet(const std::vector<ThreadAccess> &first,
                   const std::vector<ThreadAccess> &second) {
  for (const ThreadAccess &b : second)
    for (const ThreadAccess &a : first)
      if ((a.writes || b.writes) && meet(a, b))
        return true;
  return false;
}

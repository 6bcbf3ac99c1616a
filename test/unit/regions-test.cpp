//===- regions-test.cpp - Regions of an array that a launch accesses ------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "warp/Compile.h"
#include "warp/Kernel.h"
#include "warp/RegionMap.h"

#include "gtest/gtest.h"

#include <algorithm>
#include <cstring>
#include <random>
#include <set>

using namespace warp;
using Op = RegionFormula::Op;

static void collectBytes(const MemoryBlock &block, std::set<uint64_t> &bytes,
                         int dim = 0, uint64_t offset = 0) {
  if (dim < block.rank) {
    const MemoryBlock::Dim &d = block.dims[dim];
    for (int64_t k = 0; k < d.count; ++k)
      collectBytes(block, bytes, dim + 1, offset + d.stride * d.step * k);
    return;
  }
  for (int64_t i = 0; i < block.item; ++i)
    bytes.insert(block.start + offset + i);
}

static std::set<uint64_t> bytesOf(const Region &region) {
  std::set<uint64_t> bytes;
  for (const MemoryBlock &block : region.blocks)
    collectBytes(block, bytes);
  return bytes;
}

static bool meets(const std::set<uint64_t> &a, const std::set<uint64_t> &b) {
  return std::any_of(a.begin(), a.end(),
                     [&](uint64_t byte) { return b.count(byte) != 0; });
}

namespace {

/// Random parts of one matrix of floats.
struct Parts {
  std::mt19937 random{1};

  int64_t below(int64_t n) { return int64_t(random() % uint64_t(n)); }
  MemoryBlock block() {
    MemoryBlock result;
    result.start = 4096;
    result.item = 4;
    for (auto [stride, extent] : {std::pair(48, 9), std::pair(4, 12)}) {
      int64_t step = 1 + below(3), low = below(extent);
      int64_t count = 1 + below((extent - 1 - low) / step + 1);
      result.start += stride * low;
      if (count > 1)
        result.dims[result.rank++] = {stride, step, count};
    }
    return result;
  }
  Region region() {
    Region result;
    for (int64_t i = 1 + below(2); i > 0; --i)
      result.add(block());
    return result;
  }
};

} // namespace

TEST(Regions, SharedPartsAreThoseOfTheirBytes) {
  Parts parts;
  int sharing = 0;
  for (int i = 0; i < 4000; ++i) {
    MemoryBlock a = parts.block(), b = parts.block(), both;
    std::set<uint64_t> first, second, expected, found;
    collectBytes(a, first);
    collectBytes(b, second);
    std::set_intersection(first.begin(), first.end(), second.begin(),
                          second.end(),
                          std::inserter(expected, expected.end()));
    if (intersect(a, b, both))
      collectBytes(both, found);
    ASSERT_EQ(found, expected);
    sharing += !found.empty();
    Region whole;
    whole.add(a);
    Region other;
    other.add(b);
    ASSERT_EQ(whole.isWithin(other), found == first);
  }
  EXPECT_GT(sharing, 500);
  EXPECT_LT(sharing, 3500);
}

TEST(Regions, StridesThatDoNotNestAreNeverMissed) {
  // Rows of 12 bytes and of 8: digits say nothing, so all of it is shared.
  MemoryBlock a, b, both;
  a.start = 4096, a.item = 4, a.rank = 1, a.dims[0] = {12, 1, 4};
  b.start = 4100, b.item = 4, b.rank = 1, b.dims[0] = {8, 1, 4};
  ASSERT_TRUE(intersect(a, b, both));
  EXPECT_TRUE(both == a);
}

TEST(RegionMap, FindsWhatSharesBytes) {
  Parts parts;
  RegionMap map;
  std::map<int64_t, std::set<uint64_t>> known;
  for (int round = 0; round < 600; ++round) {
    Region region = parts.region();
    std::set<uint64_t> bytes = bytesOf(region);
    std::vector<int64_t> found, expected;
    map.meeting(region, found);
    for (const auto &[number, other] : known)
      if (meets(other, bytes))
        expected.push_back(number);
    ASSERT_EQ(found, expected);
    if (known.size() > 20) {
      int64_t number = std::next(known.begin(), parts.below(20))->first;
      map.remove(number);
      known.erase(number);
      continue;
    }
    int64_t number = map.add(region);
    EXPECT_EQ(map.add(region), number);
    known[number] = bytes;
    EXPECT_EQ(map.size(), known.size());
  }
}

namespace {

/// A launch of a kernel with one matrix of floats and an integer.
struct Launch {
  struct Params {
    LaunchHeader header;
    ArrayDescriptor array;
    int32_t k = 0;
  } params;
  LaunchDim dim;
  RegionFormula formula;
  std::vector<Access> accesses{1};

  Launch(int rows, int columns, int k) {
    params.array.data = reinterpret_cast<void *>(4096);
    params.array.ndim = 2;
    params.array.shape[0] = rows, params.array.shape[1] = columns;
    params.array.strides[0] = 4 * columns, params.array.strides[1] = 4;
    params.k = k;
    dim.extent[0] = columns;
    accesses[0].loaded = accesses[0].stored = true;
    accesses[0].offset = offsetof(Params, array);
    accesses[0].elementSize = 4;
    formula.unknown = {false};
    node(Op::Constant, 1);
    node(Op::Extent, 0);
    formula.nodes.push_back({Op::Argument, 32, true, offsetof(Params, k), 0});
  }
  int32_t node(Op op, int64_t a, int64_t b = 0) {
    formula.nodes.push_back({op, 64, true, a, b});
    return int32_t(formula.nodes.size()) - 1;
  }
  /// x[row, thread index] is read or written.
  void access(int32_t row, bool writes) {
    RegionFormula::Index first, second;
    first.base = row;
    second.base = node(Op::Constant, 0);
    second.symbols = {{0, 1}};
    formula.accesses.push_back({0, !writes, writes, {first, second}});
  }
  ArrayRegions run() {
    std::vector<ArrayRegions> regions;
    findRegions(formula, accesses, dim, &params, regions);
    return regions[0];
  }
};

} // namespace

static std::set<uint64_t> row(int number, int columns) {
  std::set<uint64_t> bytes;
  for (int i = 0; i < 4 * columns; ++i)
    bytes.insert(4096 + uint64_t(number) * 4 * columns + i);
  return bytes;
}

TEST(RegionFormula, RowsOfATrajectory) {
  Launch launch(5, 7, 2);
  launch.access(2, false);
  launch.access(launch.node(Op::Add, 2, 0), true);
  ArrayRegions found = launch.run();
  EXPECT_EQ(bytesOf(found.read), row(2, 7));
  EXPECT_EQ(bytesOf(found.written), row(3, 7));
  EXPECT_FALSE(found.read.overlaps(found.written));
}

TEST(RegionFormula, NegativeRowsCountFromTheEnd) {
  Launch launch(5, 7, -2);
  launch.access(2, false);
  launch.access(launch.node(Op::Add, 2, 0), true);
  ArrayRegions found = launch.run();
  EXPECT_EQ(bytesOf(found.read), row(3, 7));
  EXPECT_EQ(bytesOf(found.written), row(4, 7));
}

TEST(RegionFormula, RowsOfARing) {
  Launch launch(5, 7, 9);
  int32_t rows = launch.node(Op::Constant, 5);
  launch.access(launch.node(Op::Mod, 2, rows), false);
  int32_t after = launch.node(Op::Add, 2, 0);
  launch.access(launch.node(Op::Mod, after, rows), true);
  ArrayRegions found = launch.run();
  EXPECT_EQ(bytesOf(found.read), row(4, 7));
  EXPECT_EQ(bytesOf(found.written), row(0, 7));
}

TEST(RegionFormula, RowsThatTouchBecomeOneBlock) {
  Launch launch(5, 7, 2);
  launch.access(launch.node(Op::Sub, 2, 0), false);
  launch.access(launch.node(Op::Add, 2, 0), false);
  EXPECT_EQ(launch.run().read.blocks.size(), 2u);
  launch.access(2, false);
  ASSERT_EQ(launch.run().read.blocks.size(), 1u);
  EXPECT_EQ(launch.run().read.bytes(), 3 * 28);
}

TEST(RegionFormula, WhatIsNotKnownIsEverything) {
  Launch launch(5, 7, 2);
  launch.formula.accesses.push_back({0, true, true, {{}, {}}});
  ArrayRegions found = launch.run();
  EXPECT_EQ(found.read.bytes(), 5 * 7 * 4);
  EXPECT_TRUE(found.read == found.written);
  launch.formula.accesses.clear();
  launch.formula.unknown = {true};
  EXPECT_EQ(launch.run().written.bytes(), 5 * 7 * 4);
}

TEST(RegionFormula, IntegersWrapLikeThoseOfTheKernel) {
  Launch launch(5, 7, INT32_MAX);
  launch.formula.nodes.push_back({Op::Add, 32, true, 2, 0});
  auto sum = int32_t(launch.formula.nodes.size()) - 1;
  int32_t rows = launch.node(Op::Constant, 5);
  launch.access(launch.node(Op::Mod, sum, rows), false);
  // -2^31 % 5 is -3, which counts from the end.
  EXPECT_EQ(bytesOf(launch.run().read), row(2, 7));
}

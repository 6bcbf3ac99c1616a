//===- overlap-test.cpp - Shared memory of a launch's arrays --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Runtime/Overlap.h"
#include "warp/Memory.h"

#include "gtest/gtest.h"

#include <utility>

using namespace warp;

namespace {

/// A launch with arrays of floats at made-up addresses.
struct Arrays {
  std::vector<Access> accesses;
  std::vector<ArrayDescriptor> descriptors;

  void add(bool written, uint64_t data, int extent, int stride = 4,
           uint64_t grad = 0) {
    ArrayDescriptor array;
    array.data = reinterpret_cast<void *>(data);
    array.grad = reinterpret_cast<void *>(grad);
    array.ndim = 1;
    array.shape[0] = extent;
    array.strides[0] = stride;
    Access access;
    access.stored = written;
    access.offset = int64_t(descriptors.size() * sizeof(array));
    access.elementSize = 4;
    accesses.push_back(access);
    descriptors.push_back(array);
  }
  void useGradients(int64_t size) {
    for (Access &access : accesses)
      access.gradientSize = size;
  }
  /// The answer, which is the same with and without facts.
  bool disjoint() const {
    bool answer = areDisjoint(accesses, descriptors.data());
    std::vector<ArrayDescriptor> described = descriptors;
    for (size_t i = 0; i < described.size(); ++i)
      described[i].flags = arrayFacts(described[i], accesses[i].elementSize);
    EXPECT_EQ(areDisjoint(accesses, described.data()), answer);
    return answer;
  }
};

} // namespace

TEST(Overlap, SeesOneSharedByte) {
  for (auto [begin, expected] : {std::pair(4096 + 396, false),
                                 std::pair(4096 + 400, true),
                                 std::pair(4096 - 400, true),
                                 std::pair(4096 - 399, false)}) {
    Arrays forward, backward;
    forward.add(false, 4096, 100);
    forward.add(true, begin, 100);
    backward.add(true, begin, 100);
    backward.add(false, 4096, 100);
    EXPECT_EQ(forward.disjoint(), expected) << begin;
    EXPECT_EQ(backward.disjoint(), expected) << begin;
  }
}

TEST(Overlap, LetsReadersShare) {
  Arrays arrays;
  arrays.add(false, 4096, 100);
  arrays.add(false, 4096, 100);
  arrays.add(true, 8192, 100);
  EXPECT_TRUE(arrays.disjoint());
  arrays.add(true, 8192 + 40, 1);
  EXPECT_FALSE(arrays.disjoint());
}

TEST(Overlap, FollowsStridesOfEitherSign) {
  Arrays below;
  below.add(true, 4096, 100, -8);
  below.add(false, 4096 - 99 * 8, 1);
  EXPECT_FALSE(below.disjoint());
  Arrays above;
  above.add(true, 4096, 100, -8);
  above.add(false, 4100, 1);
  EXPECT_TRUE(above.disjoint());
}

TEST(Overlap, IgnoresWhatHasNoElements) {
  Arrays arrays;
  arrays.add(true, 4096, 100);
  arrays.add(true, 4096, 0);
  arrays.add(true, 0, 100);
  EXPECT_TRUE(arrays.disjoint());
}

TEST(Overlap, CountsGradientsWhereTheKernelUsesThem) {
  Arrays arrays;
  arrays.add(true, 4096, 100, 4, 16384);
  arrays.add(false, 8192, 100, 4, 16384 + 396);
  EXPECT_TRUE(arrays.disjoint());
  arrays.useGradients(4);
  EXPECT_FALSE(arrays.disjoint());
  arrays.descriptors[1].grad = reinterpret_cast<void *>(16384 + 400);
  EXPECT_TRUE(arrays.disjoint());
}

TEST(Overlap, GradientsMayBeWiderThanElements) {
  Arrays arrays;
  arrays.add(true, 4096, 100, 2, 16384);
  arrays.add(false, 8192, 100, 2, 16384 + 398);
  for (Access &access : arrays.accesses)
    access.elementSize = 2;
  arrays.useGradients(4);
  EXPECT_FALSE(arrays.disjoint());
}

TEST(Overlap, GivesUpOnManyArrays) {
  Arrays arrays;
  for (int i = 0; i < 60; ++i)
    arrays.add(true, 4096 * (i + 1), 10);
  EXPECT_FALSE(arrays.disjoint());
}

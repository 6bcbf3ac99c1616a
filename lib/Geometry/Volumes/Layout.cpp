//===- Layout.cpp - NanoVDB offsets by value type -------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Layout.h"

#include "warp/Error.h"

#include <algorithm>
#include <cstdlib>
#include <new>

using namespace warp;
using namespace warp::geometry;

using Scalar = ValueFacts::Scalar;

/// Bytes of a value, its alignment, bytes of a mean.
static constexpr ValueFacts allFacts[] = {
    {VoxelType::Float, "float", 4, 4, 4, Scalar::Float, 1},
    {VoxelType::Double, "double", 8, 8, 8, Scalar::Double, 1},
    {VoxelType::Int16, "int16", 2, 2, 4, Scalar::Int16, 1},
    {VoxelType::Int32, "int32", 4, 4, 4, Scalar::Int32, 1},
    {VoxelType::Int64, "int64", 8, 8, 8, Scalar::Int64, 1},
    {VoxelType::Vec3f, "Vec3f", 12, 4, 4, Scalar::Float, 3},
    {VoxelType::Vec3d, "Vec3d", 24, 8, 8, Scalar::Double, 3},
    {VoxelType::Half, "Half", 2, 2, 4, Scalar::Half, 1},
    {VoxelType::UInt32, "uint32", 4, 4, 4, Scalar::UInt32, 1},
    {VoxelType::Vec4f, "Vec4f", 16, 4, 4, Scalar::Float, 4},
    {VoxelType::Vec4d, "Vec4d", 32, 8, 8, Scalar::Double, 4},
    {VoxelType::Index, "Index", 8, 8, 8, Scalar::Int64, 1},
    {VoxelType::OnIndex, "OnIndex", 8, 8, 8, Scalar::Int64, 1},
    {VoxelType::IndexMask, "IndexMask", 8, 8, 8, Scalar::Int64, 1},
    {VoxelType::OnIndexMask, "OnIndexMask", 8, 8, 8, Scalar::Int64, 1},
    {VoxelType::UInt8, "uint8", 1, 1, 4, Scalar::UInt8, 1},
};

const ValueFacts *warp::geometry::factsOf(uint32_t type) {
  for (const ValueFacts &facts : allFacts)
    if (uint32_t(facts.type) == type)
      return &facts;
  return nullptr;
}

std::string warp::nameOf(VoxelType type) {
  const ValueFacts *facts = factsOf(uint32_t(type));
  return facts ? facts->name : "Unknown";
}

const std::vector<std::pair<VoxelType, std::string>> &warp::voxelTypes() {
  static const auto all = [] {
    std::vector<std::pair<VoxelType, std::string>> types;
    for (const ValueFacts &facts : allFacts)
      types.push_back({facts.type, facts.name});
    return types;
  }();
  return all;
}

/// Behind `values` values, their mean and their spread.
static int64_t behind(int64_t start, int values, const ValueFacts &facts) {
  int64_t means = roundUp(start + int64_t(values) * facts.size, facts.mean);
  return roundUp(means + 2 * int64_t(facts.mean), 32);
}

static GridLayout layoutOf(const ValueFacts &facts) {
  GridLayout at{};
  at.rootAt = headSize;
  at.value = facts.size;
  // For the root: also its background.
  at.background = roundUp(28, facts.align);
  at.root = behind(at.background, 3, facts);
  at.tileValue = roundUp(20, facts.align);
  at.tile = roundUp(at.tileValue + facts.size, 32);
  at.entry = roundUp(std::max(facts.size, 8), 8);
  at.upperTable = behind(sizeof(InnerHead) + 2 * upperCells / 8, 2, facts);
  at.upper = at.upperTable + upperCells * at.entry;
  at.lowerTable = behind(sizeof(InnerHead) + 2 * lowerCells / 8, 2, facts);
  at.lower = at.lowerTable + lowerCells * at.entry;
  if (isIndex(uint32_t(facts.type))) {
    bool hasMask = facts.type >= VoxelType::IndexMask;
    at.leafTable = sizeof(LeafHead);
    at.leaf = hasMask ? 160 : 96;
  } else {
    at.leafTable = behind(sizeof(LeafHead), 2, facts);
    at.leaf = roundUp(at.leafTable + leafCells * facts.size, 32);
  }
  return at;
}

GridLayout warp::gridLayout(VoxelType type) {
  const ValueFacts *facts = factsOf(uint32_t(type));
  if (!facts)
    throw Error(Error::Kind::Runtime,
                "Invalid NanoVDB grid structure: a grid of type " +
                    std::to_string(uint32_t(type)) + " is not supported");
  return layoutOf(*facts);
}

/// Grids begin at multiples of this.
static constexpr size_t alignment = 32;

GridBytes::GridBytes(size_t size) : length(size) {
  // The system's zeros cost nothing where they are not written.
  void *room = std::calloc(size + alignment, 1);
  if (!room)
    throw std::bad_alloc();
  auto address = reinterpret_cast<uintptr_t>(room);
  auto *aligned = reinterpret_cast<uint8_t *>((address + alignment - 1) /
                                              alignment * alignment);
  start = std::shared_ptr<uint8_t>(aligned, [room](uint8_t *) { free(room); });
}

GridBytes::GridBytes(const void *bytes, size_t size) : GridBytes(size) {
  if (size)
    std::memcpy(start.get(), bytes, size);
}

GridBytes GridBytes::around(uint8_t *bytes, size_t size) {
  GridBytes some;
  some.start = std::shared_ptr<uint8_t>(std::shared_ptr<void>(), bytes);
  some.length = size;
  return some;
}

GridBytes GridBytes::part(size_t from, size_t size) const {
  GridBytes some;
  some.start = std::shared_ptr<uint8_t>(start, start.get() + from);
  some.length = size;
  return some;
}

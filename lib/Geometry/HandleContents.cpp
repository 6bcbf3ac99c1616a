//===- HandleContents.cpp - Pointers among the words of a handle ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Which words are addresses depends on the kind of the object alone. How far
// they reach is in descriptors, in counts beside them, or was said when the
// words were written.
//
//===----------------------------------------------------------------------===//

#include "Slots.h"

#include "DeviceLib/geometry/Tree.h"
#include "DeviceLib/geometry/Volume.h"
#include "DeviceLib/geometry/Winding.h"
#include "Runtime/Overlap.h"

#include <algorithm>
#include <cstring>

using namespace warp;
using namespace warp::geometry;

namespace {

/// A descriptor among the words.
struct ArrayAt {
  uint32_t byte;
  int64_t elementSize;
};

struct Layout {
  std::vector<uint32_t> pointers;
  std::vector<ArrayAt> arrays;
};

} // namespace

/// As in Mesh.cpp and HashGrid.cpp.
static Layout layoutOf(GeometryKind kind) {
  constexpr uint32_t size = sizeof(ArrayDescriptor);
  constexpr uint32_t nodes = offsetof(Tree, nodes);
  constexpr uint32_t blocks = offsetof(Tree, blocks);
  constexpr uint32_t moments = extrasOffset + offsetof(TreeExtras, moments);
  constexpr uint32_t groups = extrasOffset + offsetof(TreeExtras, groups);
  switch (kind) {
  case GeometryKind::HashGrid:
    return {{}, {{32, 4}, {32 + size, 4}, {32 + 2 * size, 4}}};
  case GeometryKind::Bvh:
    return {{nodes, blocks, moments, groups}, {}};
  case GeometryKind::Mesh: {
    constexpr uint32_t first = sizeof(Tree);
    return {{nodes, blocks, moments, groups},
            {{first, 12}, {first + size, 12}, {first + 2 * size, 4}}};
  }
  case GeometryKind::Volume:
    return {{offsetof(VolumeSlot, grid), offsetof(VolumeSlot, root),
             offsetof(VolumeSlot, leaves), offsetof(VolumeSlot, leavesEnd),
             offsetof(VolumeSlot, numbers)},
            {}};
  }
  return {};
}

std::vector<uint32_t> warp::pointerWords(GeometryKind kind) {
  Layout layout = layoutOf(kind);
  std::vector<uint32_t> words;
  for (uint32_t byte : layout.pointers)
    words.push_back(byte / 8);
  for (const ArrayAt &array : layout.arrays) {
    words.push_back((array.byte + offsetof(ArrayDescriptor, data)) / 8);
    words.push_back((array.byte + offsetof(ArrayDescriptor, grad)) / 8);
  }
  std::sort(words.begin(), words.end());
  return words;
}

bool warp::geometry::isPossible(
    GeometryKind kind, const std::array<uint64_t, handleWords> &words) {
  const auto *bytes = reinterpret_cast<const char *>(words.data());
  for (const ArrayAt &at : layoutOf(kind).arrays) {
    ArrayDescriptor array;
    std::memcpy(&array, bytes + at.byte, sizeof array);
    if (!possibleRangeOf(array.data, array, at.elementSize, 1) ||
        !possibleRangeOf(array.grad, array, at.elementSize, 1))
      return false;
  }
  if (kind != GeometryKind::Bvh && kind != GeometryKind::Mesh)
    return true;
  Tree tree;
  TreeExtras extras;
  std::memcpy(&tree, bytes, sizeof tree);
  std::memcpy(&extras, bytes + extrasOffset, sizeof extras);
  return tree.count >= 0 && extras.groupCount >= 0;
}

/// Memory that was said to be there, and that whose size is beside it.
static std::vector<AddressRange>
rangesOf(const HandleContents &contents,
         const std::vector<HandleMemory> &memory) {
  std::vector<AddressRange> ranges;
  auto add = [&](uint64_t begin, uint64_t bytes) {
    if (begin && bytes)
      ranges.push_back({begin, begin + bytes});
  };
  uint64_t nodeBytes = 0;
  const auto *bytes = reinterpret_cast<const char *>(contents.words.data());
  Tree tree;
  std::memcpy(&tree, bytes, sizeof tree);
  for (const HandleMemory &part : memory) {
    add(reinterpret_cast<uint64_t>(part.data), part.bytes);
    if (part.data == tree.nodes)
      nodeBytes = part.bytes;
  }
  if (contents.kind != GeometryKind::Bvh && contents.kind != GeometryKind::Mesh)
    return ranges;
  TreeExtras extras;
  std::memcpy(&extras, bytes + extrasOffset, sizeof extras);
  add(reinterpret_cast<uint64_t>(extras.moments),
      nodeBytes / sizeof(Node) * sizeof(Moments));
  // Numbers and the nodes that hold them.
  add(reinterpret_cast<uint64_t>(extras.groups),
      2 * uint64_t(extras.groupCount) * sizeof(i32));
  return ranges;
}

void warp::geometry::findPointers(HandleContents &contents,
                                  const std::vector<HandleMemory> &memory) {
  Layout layout = layoutOf(contents.kind);
  std::vector<AddressRange> ranges = rangesOf(contents, memory);
  for (uint32_t byte : layout.pointers) {
    uint64_t address = contents.words[byte / 8];
    HandleContents::Pointer pointer{byte / 8, 0, 0};
    for (const AddressRange &range : ranges)
      // An empty range points behind the last leaf.
      if (address >= range.begin && address <= range.end &&
          (pointer.begin == pointer.end || address < range.end))
        pointer = {byte / 8, range.begin, range.end};
    contents.pointers.push_back(pointer);
  }
  for (const ArrayAt &at : layout.arrays) {
    ArrayDescriptor array;
    std::memcpy(&array,
                reinterpret_cast<const char *>(contents.words.data()) + at.byte,
                sizeof array);
    AddressRange data = rangeOf(array.data, array, at.elementSize, 1);
    AddressRange grad;
    if (array.grad)
      grad = rangeOf(array.grad, array, at.elementSize, 1);
    contents.pointers.push_back({at.byte / 8, data.begin, data.end});
    contents.pointers.push_back({at.byte / 8 + 1, grad.begin, grad.end});
  }
  std::sort(contents.pointers.begin(), contents.pointers.end(),
            [](const auto &a, const auto &b) { return a.word < b.word; });
}

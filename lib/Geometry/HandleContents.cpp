//===- HandleContents.cpp - Pointer fields of handle slots ----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The kind of the object alone decides which words are addresses. How far
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

static Layout layoutOf(GeometryKind kind) {
  Layout layout;
  auto addNumber = [](uint32_t, int64_t) {};
  auto addPointer = [&](uint32_t word, int64_t) {
    layout.pointers.push_back(8 * word);
  };
  auto addArray = [&](uint32_t word, int64_t elementSize) {
    layout.arrays.push_back({8 * word, elementSize});
  };
#define WARP_SLOT_FIELD(KIND, FORM, NAME, WORD, SIZE, IS_READ_ONLY)            \
  if (kind == GeometryKind::KIND)                                              \
    add##FORM(WORD, SIZE);
#include "warp/HandleKinds.inc"
  return layout;
}

// Slots are C++ structs, too.
namespace {
#define WARP_SLOT_FIELD(KIND, FORM, NAME, WORD, SIZE, IS_READ_ONLY)            \
  constexpr size_t byteOf##KIND##_##NAME [[maybe_unused]] = 8 * WORD;
#include "warp/HandleKinds.inc"
static_assert(sizeof(ArrayDescriptor) == 7 * 8);
static_assert(offsetof(Tree, nodes) == byteOfMesh_nodes);
static_assert(offsetof(Tree, nodes) == byteOfBvh_nodes);
static_assert(offsetof(Tree, blocks) == byteOfMesh_blocks);
static_assert(offsetof(Tree, blocks) == byteOfBvh_blocks);
static_assert(sizeof(Tree) == byteOfMesh_points);
static_assert(extrasOffset == byteOfMesh_moments);
static_assert(extrasOffset == byteOfBvh_moments);
static_assert(offsetof(TreeExtras, groups) ==
              byteOfMesh_group_roots - extrasOffset);
static_assert(offsetof(TreeExtras, groupCount) ==
              byteOfMesh_tree_counts - extrasOffset);
static_assert(offsetof(VolumeSlot, grid) == byteOfVolume_grid);
static_assert(offsetof(VolumeSlot, root) == byteOfVolume_root);
static_assert(offsetof(VolumeSlot, leaves) == byteOfVolume_leaves);
static_assert(offsetof(VolumeSlot, type) == byteOfVolume_type);
static_assert(offsetof(VolumeSlot, voxels) == byteOfVolume_voxels);
static_assert(offsetof(VolumeSlot, gradient) == byteOfVolume_gradient);
static_assert(offsetof(VolumeSlot, leavesEnd) == byteOfVolume_leaves_end);
static_assert(offsetof(VolumeSlot, numbers) == byteOfVolume_numbers);
static_assert(offsetof(VolumeSlot, lowest) == byteOfVolume_box);
} // namespace

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

static bool isTree(GeometryKind kind) {
  return kind == GeometryKind::Bvh || kind == GeometryKind::Mesh;
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
  if (!isTree(kind))
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
  if (!isTree(contents.kind))
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

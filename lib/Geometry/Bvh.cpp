//===- Bvh.cpp - Bounding volume hierarchies ------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "warp/Bvh.h"

#include "DeviceTree.h"
#include "Recording.h"

#include <limits>

using namespace warp;
using namespace warp::geometry;

namespace {

struct Boxes {
  Boxes(const ArrayDescriptor &lowers, const ArrayDescriptor &uppers,
        int device)
      : lowers(lowers, device), uppers(uppers, device) {
    if (this->lowers.size() != this->uppers.size())
      throw Error(Error::Kind::Runtime,
                  "a Bvh needs as many lower corners as upper ones, but got " +
                      std::to_string(this->lowers.size()) + " and " +
                      std::to_string(this->uppers.size()));
  }

  int64_t size() const { return lowers.size(); }
  Bounds operator[](int64_t i) const {
    Bounds bounds;
    std::memcpy(bounds.low, &lowers[i], sizeof bounds.low);
    std::memcpy(bounds.high, &uppers[i], sizeof bounds.high);
    return bounds;
  }

  HostElements<Float3> lowers, uppers;
};

/// The slot of a Bvh.
struct BvhSlot {
  Tree tree;
  char unused[extrasOffset - sizeof(Tree)];
  TreeExtras extras;
};
static_assert(sizeof(BvhSlot) <= slotSize);

} // namespace

struct Bvh::Impl {
  explicit Impl(int device)
      : slot(GeometryKind::Bvh, device), onDevice(device) {}

  void build(const Boxes &boxes, const ArrayDescriptor &groups,
             Splitting splitting);
  void refit(const Boxes &boxes);
  int fill(const Boxes &boxes, BoxBlock &block) const;
  void publish();
  void write(const Tree &searched, const TreeExtras &extras,
             std::vector<HandleMemory> memory);

  Slot slot;
  Hierarchy<BoxBlock> tree;
  DeviceTree<BoxBlock> onDevice;
  /// From the last build; owned by the caller.
  ArrayDescriptor groups;
  float scale = 1;
  int64_t count = 0;
};

int Bvh::Impl::fill(const Boxes &boxes, BoxBlock &block) const {
  constexpr float none = std::numeric_limits<float>::quiet_NaN();
  int improper = 0;
  for (int lane = 0; lane < width; ++lane) {
    int32_t id = block.id[lane];
    Bounds bounds = id >= 0 ? boxes[id] : Bounds();
    bool isThere = bounds.isProper();
    improper += id >= 0 && !isThere;
    for (int axis = 0; axis < 3; ++axis) {
      block.bounds[axis][lane] = isThere ? bounds.low[axis] * scale : none;
      block.bounds[3 + axis][lane] = isThere ? bounds.high[axis] * scale : none;
    }
  }
  return improper;
}

void Bvh::Impl::build(const Boxes &boxes, const ArrayDescriptor &groupArray,
                      Splitting splitting) {
  count = boxes.size();
  this->groups = groupArray;
  HostElements<int32_t> groups(groupArray, slot.device());
  bool hasGroups = groups.size() > 0;
  if (hasGroups && groups.size() != count)
    throw Error(Error::Kind::Runtime,
                "a Bvh with groups has one for each of its " +
                    std::to_string(count) + " boxes, but got " +
                    std::to_string(groups.size()));
  std::vector<BuildPrimitive> primitives;
  primitives.reserve(count);
  for (int64_t i = 0; i < count; ++i) {
    Bounds bounds = boxes[i];
    int32_t group = hasGroups ? groups[i] : 0;
    if (bounds.isProper())
      primitives.push_back({bounds.finite(), int32_t(i), group});
    else
      primitives.push_back(BuildPrimitive::improper(int32_t(i), group));
  }
  tree.build(
      std::move(primitives), splitting, hasGroups,
      [&](const Bounds &all) { scale = chooseScale(all); },
      [&](BoxBlock &block) { return fill(boxes, block); });
  publish();
}

void Bvh::Impl::refit(const Boxes &boxes) {
  if (boxes.size() != count)
    throw Error(Error::Kind::Runtime,
                "a refitted Bvh keeps its " + std::to_string(count) +
                    " boxes, but got " + std::to_string(boxes.size()));
  Bounds all;
  for (int64_t i = 0; i < count; ++i)
    if (Bounds bounds = boxes[i]; bounds.isProper())
      all.include(bounds.finite());
  scale = chooseScale(all);
  tree.refit([&](BoxBlock &block) { return fill(boxes, block); });
  publish();
}

void Bvh::Impl::publish() {
  Tree searched = onDevice.describe(tree, scale, count);
  write(searched, onDevice.describeExtras(tree, {}), memoryOf(tree, searched));
}

void Bvh::Impl::write(const Tree &searched, const TreeExtras &extras,
                      std::vector<HandleMemory> memory) {
  BvhSlot contents{searched, {}, extras};
  // The slot writes the first word.
  slot.write(&contents.tree.nodes, sizeof contents - sizeof contents.tree.tag,
             std::move(memory));
}

Bvh::Bvh(const ArrayDescriptor &lowers, const ArrayDescriptor &uppers,
         int device, BvhConstructor constructor, const ArrayDescriptor &groups)
    : impl(std::make_shared<Impl>(device)) {
  impl->count = lowers.shape[0];
  if (constructor != BvhConstructor::None)
    impl->build(Boxes(lowers, uppers, device), groups,
                splittingOf(constructor));
}

Bvh::~Bvh() = default;

uint64_t Bvh::id() const { return impl->slot.id(); }

void Bvh::refit(const ArrayDescriptor &lowers, const ArrayDescriptor &uppers) {
  update(impl->slot, noteOf(impl->slot, {lowers, uppers, impl->groups}),
         [impl = impl, lowers, uppers] {
           impl->refit(Boxes(lowers, uppers, impl->slot.device()));
         });
}

void Bvh::rebuild(const ArrayDescriptor &lowers, const ArrayDescriptor &uppers,
                  BvhConstructor constructor, const ArrayDescriptor &groups) {
  update(impl->slot,
         rebuildOf(noteOf(impl->slot, {lowers, uppers, groups}), constructor),
         [impl = impl, lowers, uppers, groups, constructor] {
           impl->build(Boxes(lowers, uppers, impl->slot.device()), groups,
                       splittingOf(constructor));
         });
}

void Bvh::adopt(const BuiltTree &built) {
  impl->write(treeOf(built, impl->count), extrasOf(built), memoryOf(built));
}

HierarchyView Bvh::view() const {
  return viewOf(impl->tree, impl->onDevice, impl->scale);
}

BvhReport Bvh::report() const { return reportOf(impl->tree); }

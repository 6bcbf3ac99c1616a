//===- Geometry.cpp - Geometry of graphs in files -------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Geometry.h"

#include "DeviceLib/geometry/Tree.h"
#include "warp/Error.h"

#include <algorithm>
#include <cstring>

using namespace warp;
using namespace warp::graphs;

//===----------------------------------------------------------------------===//
// Saving
//===----------------------------------------------------------------------===//

std::optional<uint32_t> FoundHandles::find(uint64_t word,
                                           const std::string &where) {
  if (word == 0)
    return {};
  auto known = numbers.find(word);
  if (known != numbers.end())
    return known->second;
  if (!findHandle(word, device)) {
    constexpr const char *none = "a number that is none";
    std::string what = describeHandle(word, GeometryKind::HashGrid, device);
    if (what == none)
      return {};
    throw Error(Error::Kind::Runtime, "cannot save the graph: the " + where +
                                          " has the id of " +
                                          what.substr(sizeof("that of ") - 1));
  }
  auto number = uint32_t(contents.size());
  contents.push_back(readHandle(word));
  addresses.push_back(handleAddress(word));
  numbers[word] = number;
  return number;
}

std::optional<uint32_t> FoundHandles::around(const AddressRange &range) const {
  for (size_t i = 0; i < addresses.size(); ++i)
    if (range.begin >= addresses[i] &&
        range.end <= addresses[i] + handleWords * sizeof(uint64_t))
      return uint32_t(i);
  return {};
}

//===----------------------------------------------------------------------===//
// Loading
//===----------------------------------------------------------------------===//

void Geometry::make(const GraphFile &file, int onDevice) {
  device = onDevice;
  for (const FileHandle &handle : file.handles)
    objects.push_back(
        std::make_unique<GeometryHandle>(GeometryKind(handle.kind), device));
}

static MeshArrays meshArrays(const UpdateGeometry &update) {
  const ArrayDescriptor *arrays = update.arrays;
  return {arrays[0], arrays[1], arrays[2], arrays[3]};
}

/// Cells along the axes, and where each begins, as HashGrid.cpp writes them.
static std::unique_ptr<HashGrid> gridOf(const FileHandle &handle) {
  int32_t cells[3];
  const auto *bytes = reinterpret_cast<const char *>(handle.words.data());
  std::memcpy(cells, bytes + sizeof(uint64_t), sizeof cells);
  ArrayDescriptor starts;
  std::memcpy(&starts, bytes + 32, sizeof starts);
  double all = double(cells[0]) * cells[1] * cells[2];
  if (std::min({cells[0], cells[1], cells[2]}) < 1 ||
      starts.shape[0] != all + 1)
    throw Error(Error::Kind::Value, "a hash grid has another number of cells");
  return std::make_unique<HashGrid>(cells);
}

/// Only meshes for winding numbers have moments.
static bool hasMoments(const FileHandle &handle) {
  std::vector<uint32_t> words = pointerWords(GeometryKind::Mesh);
  auto found = std::find(words.begin(), words.end(),
                         warp::geometry::extrasOffset / sizeof(uint64_t));
  return handle.blocks[found - words.begin()] != nullBlock;
}

void Geometry::prepare(uint32_t number, const FileHandle &handle,
                       const UpdateGeometry &update) {
  if (handle.kind != update.kind || !isHost(device))
    throw Error(Error::Kind::Value, "an update has other geometry");
  if (!std::holds_alternative<std::unique_ptr<GeometryHandle>>(objects[number]))
    return;
  switch (GeometryKind(handle.kind)) {
  case GeometryKind::HashGrid:
    objects[number] = gridOf(handle);
    return;
  case GeometryKind::Bvh:
    objects[number] =
        std::make_unique<Bvh>(update.arrays[0], update.arrays[1], device,
                              BvhConstructor::Sah, update.arrays[2]);
    return;
  default:
    objects[number] = std::make_unique<Mesh>(
        meshArrays(update), device, BvhConstructor::Sah, hasMoments(handle));
  }
}

void Geometry::write(uint32_t number,
                     const std::array<uint64_t, handleWords> &words) {
  auto *handle = std::get_if<std::unique_ptr<GeometryHandle>>(&objects[number]);
  if (handle)
    return (*handle)->write(words.data() + 1,
                            sizeof words - sizeof words.front());
  for (unsigned i = 1; i < handleWords; ++i)
    writeHandleWord(id(number), i, words[i]);
}

uint64_t Geometry::id(uint32_t number) const {
  return std::visit([](const auto &object) { return object->id(); },
                    objects[number]);
}

void Geometry::update(const UpdateGeometry &update) const {
  for (const Object &object : objects) {
    if (std::visit([](const auto &o) { return o->id(); }, object) !=
        update.handle)
      continue;
    auto constructor = BvhConstructor(update.constructor);
    if (auto *grid = std::get_if<std::unique_ptr<HashGrid>>(&object))
      return (*grid)->build(update.arrays[0], update.scalarSize, update.width,
                            update.arrays[1]);
    if (auto *bvh = std::get_if<std::unique_ptr<Bvh>>(&object))
      return update.rebuilds
                 ? (*bvh)->rebuild(update.arrays[0], update.arrays[1],
                                   constructor, update.arrays[2])
                 : (*bvh)->refit(update.arrays[0], update.arrays[1]);
    if (auto *mesh = std::get_if<std::unique_ptr<Mesh>>(&object))
      return update.rebuilds ? (*mesh)->rebuild(meshArrays(update), constructor)
                             : (*mesh)->refit(meshArrays(update));
  }
  throw Error(Error::Kind::Value, "an update has no geometry");
}

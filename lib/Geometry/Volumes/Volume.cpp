//===- Volume.cpp - Sparse volumes (NanoVDB) for kernels ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// If leaves are dense a table of them stands beside the grid, by which most
// voxels are found without a walk from the root.
//
//===----------------------------------------------------------------------===//

#include "warp/Volume.h"

#include "Contents.h"
#include "Slots.h"

#include "warp/Memory.h"

#include <cmath>

using namespace warp;
using namespace warp::geometry;

struct Volume::Impl {
  explicit Impl(int device) : slot(GeometryKind::Volume, device) {}

  void adopt(const GridBytes &grids);
  void publish(GridBytes host);
  GridBytes toHost(size_t bytes) const;
  Levels levels(GridBytes &host) const;
  const VolumeSlot &readable() const;
  bool isHere() const { return isHost(slot.device()); }

  Slot slot;
  uint8_t *data = nullptr;
  size_t size = 0;
  /// Null if the memory is the caller's.
  std::shared_ptr<void> memory;
  /// The table of leaves, where the device reads it.
  std::shared_ptr<Buffer> table;
  VolumeSlot contents{};
  GridInfo info;
  /// As they were when they were checked.
  std::vector<GridFeature> features;
};

/// Bytes of the grid, and of those behind it; the memory itself if that is of
/// the host.
GridBytes Volume::Impl::toHost(size_t bytes) const {
  if (isHere())
    return GridBytes::around(data, bytes);
  GridBytes host(bytes);
  download(host.data(), data, slot.device(), bytes);
  return host;
}

Levels Volume::Impl::levels(GridBytes &host) const {
  host = toHost(size_t(info.size));
  return Levels(host.data(), host.size());
}

/// Takes memory of the host, or copies it to the device.
void Volume::Impl::adopt(const GridBytes &grids) {
  checkedLevels(grids.data(), grids.size());
  if (isHere()) {
    memory = grids.owner();
    data = grids.data();
  } else {
    auto copy = std::make_shared<Buffer>(slot.device(), grids.size());
    upload(copy->data(), slot.device(), grids.data(), grids.size());
    // Kernels that are queued may read what is freed here.
    if (data)
      synchronizeDevice(slot.device());
    data = static_cast<uint8_t *>(copy->data());
    memory = std::move(copy);
  }
  size = grids.size();
  publish(grids);
}

/// Lets kernels find a grid, whose bytes are here, too.
void Volume::Impl::publish(GridBytes host) {
  Levels levels = checkedLevels(host.data(), host.size());
  std::vector<GridFeature> found = featuresOf(levels);
  if (reinterpret_cast<uintptr_t>(data) % 8)
    throw Error(Error::Kind::Runtime,
                "a NanoVDB grid starts at a multiple of 8 bytes");
  LeafTable leaves(levels);
  size_t bytes = leaves.numbers.size() * sizeof(uint32_t);
  std::shared_ptr<Buffer> made;
  if (bytes) {
    made = std::make_shared<Buffer>(slot.device(), bytes);
    upload(made->data(), slot.device(), leaves.numbers.data(), bytes);
  }
  contents = slotOf(levels, data, leaves,
                    made ? static_cast<uint32_t *>(made->data()) : nullptr);
  contents.tag = slot.tag();
  auto *behindTag = reinterpret_cast<const char *>(&contents) + sizeof(u64);
  slot.write(behindTag, sizeof contents - sizeof(u64),
             {{data, size}, {contents.numbers, bytes}});
  info = levels.info();
  features = std::move(found);
  table = std::move(made);
}

Volume::Volume(const GridBytes &grids, int device)
    : impl(std::make_unique<Impl>(device)) {
  impl->adopt(grids);
}

Volume::Volume(void *grid, size_t bytes, int device)
    : impl(std::make_unique<Impl>(device)) {
  if (!grid)
    throw Error(Error::Kind::Runtime, "invalid address of a grid: 0");
  impl->data = static_cast<uint8_t *>(grid);
  if (!bytes) {
    GridBytes head = impl->toHost(size_t(headSize));
    bytes = size_t(headerOf(head.data(), head.size()).size);
  }
  impl->size = bytes;
  impl->publish(impl->toHost(bytes));
}

Volume::Volume(void *grid, size_t bytes, int device, const GridBytes &contents)
    : impl(std::make_unique<Impl>(device)) {
  impl->data = static_cast<uint8_t *>(grid);
  impl->size = bytes;
  impl->publish(contents);
}

Volume::Volume(Volume &&) noexcept = default;
Volume::~Volume() = default;

uint64_t Volume::id() const { return impl->slot.id(); }
int Volume::device() const { return impl->slot.device(); }
void *Volume::data() const { return impl->data; }
size_t Volume::size() const { return impl->size; }
std::shared_ptr<void> Volume::memory() const { return impl->memory; }
const GridInfo &Volume::info() const { return impl->info; }

void Volume::assign(const GridBytes &grids) { impl->adopt(grids); }

uint32_t Volume::rebuild(const GridRecipe &recipe, const GridPoints &points,
                         const std::optional<GridCounts> &room) {
  GridBytes made = recipe.make(points);
  if (room)
    if (uint32_t status = missingRoom(made, *room))
      return status;
  impl->adopt(made);
  return 0;
}

uint32_t warp::missingRoom(const GridBytes &grid, const GridCounts &room) {
  GridCounts needed = Levels(grid.data(), grid.size()).info().counts;
  return (needed.leaves > room.leaves ? LeafCapacityExceeded : 0u) |
         (needed.lowers > room.lowers ? LowerCapacityExceeded : 0u) |
         (needed.uppers > room.uppers ? UpperCapacityExceeded : 0u) |
         (needed.voxels > room.voxels ? VoxelCapacityExceeded : 0u);
}

void Volume::refresh() {
  size_t bytes = std::min(impl->size, size_t(headSize));
  GridBytes head(bytes);
  download(head.data(), impl->data, impl->slot.device(), bytes);
  impl->info = infoOf(head.data(), bytes);
}

int64_t Volume::tiles(int32_t *rows, int64_t room) const {
  GridBytes host;
  return listTiles(impl->levels(host), rows, room);
}

int64_t Volume::voxels(int32_t *rows, int64_t room) const {
  GridBytes host;
  return listVoxels(impl->levels(host), rows, room);
}

GridFeature Volume::feature(int64_t index) const {
  auto count = int64_t(impl->features.size());
  if (index < 0 || index >= count)
    throw Error(Error::Kind::Runtime, "the grid has " + std::to_string(count) +
                                          " feature arrays, but number " +
                                          std::to_string(index) + " was asked");
  return impl->features[index];
}

size_t Volume::next() const {
  const GridInfo &info = impl->info;
  bool isLast = uint64_t(info.index) + 1 >= info.count ||
                info.size + sizeof(GridHeader) > impl->size;
  return isLast ? 0 : size_t(info.size);
}

void Volume::save(const std::string &path, GridCodec codec) const {
  if (impl->info.index > 0)
    throw Error(Error::Kind::Runtime,
                "a volume of `load_next_grid` is saved with the one before it");
  // Room behind the last grid of memory that kernels write is not written.
  size_t bytes = size_t(impl->info.size);
  GridBytes host = impl->toHost(impl->info.count > 1 ? impl->size : bytes);
  writeGrids(path, host.data(), host.size(), codec);
}

/// The slot of a grid whose bytes the host reads.
const VolumeSlot &Volume::Impl::readable() const {
  if (!isHere())
    throw Error(
        Error::Kind::Runtime,
        "the voxels of a volume on 'cuda:" + std::to_string(slot.device()) +
            "' are read by kernels, not by the host");
  return contents;
}

int Volume::lookup(const int32_t (&voxel)[3], double (&value)[4]) const {
  return readVoxel(impl->readable(), voxel, value);
}

int Volume::sample(const double (&point)[3], Sampling how,
                   double (&value)[4]) const {
  const VolumeSlot &slot = impl->readable();
  if (how == Sampling::Linear && isInterpolated(impl->info.type))
    return sampleLinear(slot, point, value);
  int32_t voxel[3];
  for (int axis = 0; axis < 3; ++axis)
    voxel[axis] = voxelAt(std::round(point[axis]));
  return readVoxel(slot, voxel, value);
}

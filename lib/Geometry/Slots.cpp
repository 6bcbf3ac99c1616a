//===- Slots.cpp - Handles of geometry ------------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Slots.h"

#include "warp/Error.h"
#include "warp/Forks.h"
#include "warp/Memory.h"

#include <cstring>
#include <deque>
#include <unordered_map>
#include <vector>

using namespace warp;
using namespace warp::geometry;

namespace {

constexpr int generationShift = 49, deviceShift = 58;
constexpr uint64_t generations = 1 << (deviceShift - generationShift);
constexpr uint64_t addressMask = (uint64_t(1) << generationShift) - 1;
constexpr size_t slotsPerSlab = 1024;
/// Slots rest before they are used again, so that generations last.
constexpr size_t restingSlots = 256;

struct FreeSlot {
  uint64_t address, generation;
};

struct LiveSlot {
  GeometryKind kind;
  std::vector<HandleMemory> memory;
};

/// The slots of one device.
struct Pool {
  std::vector<std::unique_ptr<Buffer>> slabs;
  std::deque<FreeSlot> free;
};

struct Registry {
  ForkMutex mutex;
  std::unordered_map<int, Pool> pools;
  std::unordered_map<uint64_t, LiveSlot> live;
  /// Released handles, by slot.
  std::unordered_map<uint64_t, GeometryKind> lastKind;
};

/// Objects may outlive static destructors.
Registry &registry() {
  static auto *all = new Registry;
  return *all;
}

} // namespace

static void addSlab(Pool &pool, int device) {
  auto slab = std::make_unique<Buffer>(device, (slotsPerSlab + 1) * slotSize);
  clearNewMemory(slab->data(), device, slab->size());
  auto start = reinterpret_cast<uint64_t>(slab->data());
  start = (start + slotSize - 1) / slotSize * slotSize;
  for (size_t i = 0; i < slotsPerSlab; ++i)
    pool.free.push_back({start + i * slotSize, 1});
  pool.slabs.push_back(std::move(slab));
}

Slot::Slot(GeometryKind kind, int device)
    : geometryKind(kind), deviceIndex(device) {
  Registry &all = registry();
  std::lock_guard lock(all.mutex);
  Pool &pool = all.pools[device];
  if (pool.free.size() <= (pool.slabs.empty() ? 0 : restingSlots))
    addSlab(pool, device);
  FreeSlot slot = pool.free.front();
  pool.free.pop_front();
  handle = slot.address | slot.generation << generationShift |
           uint64_t(device + 1) << deviceShift;
  all.live[handle] = {kind, {}};
  all.lastKind[slot.address] = kind;
}

// Operations that wait for code may look handles up, so no slot is written with
// the lock held.
Slot::~Slot() {
  Registry &all = registry();
  {
    std::lock_guard lock(all.mutex);
    all.live.erase(handle);
  }
  uint64_t gone = 0, address = handle & addressMask;
  try {
    changeMemory(reinterpret_cast<void *>(address), deviceIndex, &gone,
                 sizeof gone);
  } catch (...) {
    // The device is gone, and with it the slot.
  }
  std::lock_guard lock(all.mutex);
  uint64_t generation = (handle >> generationShift) % generations;
  all.pools[deviceIndex].free.push_back(
      {address, (generation + 1) % generations});
}

uint64_t Slot::tag() const {
  return handle >> generationShift << 8 | uint64_t(geometryKind);
}

void Slot::write(const void *contents, size_t bytes,
                 std::vector<HandleMemory> memory) {
  char image[slotSize] = {};
  uint64_t word = tag();
  std::memcpy(image, &word, sizeof word);
  std::memcpy(image + sizeof word, contents, bytes);
  // No part of a graph that is being captured: it may use what is made
  // meanwhile.
  changeMemory(reinterpret_cast<void *>(handle & addressMask), deviceIndex,
               image, sizeof image);
  Registry &all = registry();
  std::lock_guard lock(all.mutex);
  all.live.at(handle).memory = std::move(memory);
}

GeometryHandle::GeometryHandle(GeometryKind kind, int device)
    : slot(std::make_unique<Slot>(kind, device)) {}

GeometryHandle::~GeometryHandle() = default;

uint64_t GeometryHandle::id() const { return slot->id(); }

GeometryKind GeometryHandle::kind() const { return slot->kind(); }

void GeometryHandle::write(const void *contents, size_t bytes,
                           std::vector<HandleMemory> memory) {
  slot->write(contents, bytes, std::move(memory));
}

static int deviceOf(uint64_t id) { return int(id >> deviceShift & 31) - 1; }

void warp::writeHandleWord(uint64_t id, unsigned index, uint64_t value) {
  {
    Registry &all = registry();
    std::lock_guard lock(all.mutex);
    if (!all.live.count(id) || index == 0 ||
        index >= slotSize / sizeof(uint64_t))
      throw Error(Error::Kind::Value, "no such word of a live handle");
  }
  auto *words = reinterpret_cast<uint64_t *>(id & addressMask);
  changeMemory(words + index, deviceOf(id), &value, sizeof value);
}

uint64_t warp::handleAddress(uint64_t id) { return id & addressMask; }

std::optional<GeometryKind> warp::findHandle(uint64_t id, int device) {
  Registry &all = registry();
  std::lock_guard lock(all.mutex);
  auto live = all.live.find(id);
  if (live == all.live.end() || deviceOf(id) != device)
    return {};
  return live->second.kind;
}

HandleContents warp::readHandle(uint64_t id) {
  HandleContents contents{};
  std::vector<HandleMemory> memory;
  {
    Registry &all = registry();
    std::lock_guard lock(all.mutex);
    auto live = all.live.find(id);
    if (live == all.live.end())
      throw Error(Error::Kind::Value, "no live handle");
    contents.kind = live->second.kind;
    memory = live->second.memory;
  }
  download(contents.words.data(),
           reinterpret_cast<const void *>(handleAddress(id)), deviceOf(id),
           slotSize);
  findPointers(contents, memory);
  return contents;
}

static const char *nameOf(GeometryKind kind) {
  switch (kind) {
#define WARP_HANDLE_KIND(KIND, NUMBER)                                         \
  case GeometryKind::KIND:                                                     \
    return #KIND;
#include "warp/HandleKinds.inc"
  }
  return "";
}

/// True if a handle of one kind is accepted for another.
static bool isFor(GeometryKind kind, GeometryKind wanted) {
#define WARP_HANDLE_BASE(KIND, BASE)                                           \
  if (kind == GeometryKind::KIND && wanted == GeometryKind::BASE)              \
    return true;
#include "warp/HandleKinds.inc"
  return kind == wanted;
}

std::string warp::describeHandle(uint64_t id, GeometryKind kind, int device) {
  Registry &all = registry();
  std::lock_guard lock(all.mutex);
  auto live = all.live.find(id);
  if (live == all.live.end()) {
    auto last = all.lastKind.find(id & addressMask);
    if (last == all.lastKind.end())
      return "a number that is none";
    return std::string("that of a freed ") + nameOf(last->second);
  }
  GeometryKind found = live->second.kind;
  if (!isFor(found, kind))
    return std::string("that of a ") + nameOf(found);
  int lives = deviceOf(id);
  if (lives == device)
    return "";
  return std::string("that of one on '") +
         (lives < 0 ? "cpu" : "cuda:" + std::to_string(lives)) + "'";
}

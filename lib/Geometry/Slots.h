//===- Slots.h - Handles of geometry ----------------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A kernel gets a geometry object as a number: the address of a slot of 256
// bytes that describes it, and above that a generation and the device.
//
//   bits 0-48 address | 49-57 generation | 58-62 device + 1 (0: the CPU)
//
// The slot's first word repeats device and generation beside the kind of the
// object, or is 0 when the object is gone. Slots are never given back to the
// system, and used again oldest first: a stale handle finds a word that does
// not fit, 512 objects long.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_GEOMETRY_SLOTS_H
#define WARP_LIB_GEOMETRY_SLOTS_H

#include "warp/Handle.h"

#include <cstddef>
#include <cstdint>

namespace warp::geometry {

inline constexpr size_t slotSize = 256;
static_assert(slotSize == handleWords * sizeof(uint64_t));

/// A handle with an owner.
class Slot {
public:
  Slot(GeometryKind kind, int device);
  ~Slot();
  Slot(const Slot &) = delete;
  Slot &operator=(const Slot &) = delete;

  uint64_t id() const { return handle; }
  GeometryKind kind() const { return geometryKind; }
  int device() const { return deviceIndex; }
  /// The required value of the slot's first word.
  uint64_t tag() const;
  /// Writes what follows the first word, and that; `memory` as for a
  /// `GeometryHandle`.
  void write(const void *contents, size_t bytes,
             std::vector<HandleMemory> memory = {});

private:
  GeometryKind geometryKind;
  int deviceIndex;
  uint64_t handle;
};

/// Completes the words of a handle by where its pointers lead to
/// (HandleContents.cpp).
void findPointers(HandleContents &contents,
                  const std::vector<HandleMemory> &memory);

/// True if words that nobody has checked describe arrays and counts that can
/// be; not where those lie.
bool isPossible(GeometryKind kind,
                const std::array<uint64_t, handleWords> &words);

} // namespace warp::geometry

#endif // WARP_LIB_GEOMETRY_SLOTS_H

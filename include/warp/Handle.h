//===- Handle.h - Geometry that kernels know by a number --------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_HANDLE_H
#define WARP_HANDLE_H

#include "warp/Export.h"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

namespace warp {

enum class GeometryKind : uint8_t {
  HashGrid = 1,
  Bvh = 2,
  Mesh = 3,
  Volume = 4
};

namespace geometry {
class Slot;
}

/// A number for kernels that leads to 256 bytes on a device, of which the
/// first eight say whose they are; it is dead when this object is gone.
class WARP_API GeometryHandle {
public:
  GeometryHandle(GeometryKind kind, int device);
  ~GeometryHandle();

  uint64_t id() const;
  /// Writes what follows the first eight bytes, at most 248.
  void write(const void *contents, size_t bytes);

private:
  std::unique_ptr<geometry::Slot> slot;
};

/// What is wrong with the handle of an object that should be alive on a
/// device, such as "the id of a freed Mesh"; empty if nothing is. A Mesh is
/// a Bvh, too.
WARP_API std::string describeHandle(uint64_t id, GeometryKind kind,
                                    int device);

/// Writes word `index`, from 1 to 31, of what a live handle leads to.
WARP_API void writeHandleWord(uint64_t id, unsigned index, uint64_t value);

} // namespace warp

#endif // WARP_HANDLE_H

//===- Handle.h - Handles of geometry objects -------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_HANDLE_H
#define WARP_HANDLE_H

#include "warp/Export.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace warp {

/// The records are in include/WarpDialect/Functions.td.
enum class GeometryKind : uint8_t {
#define WARP_HANDLE_KIND(KIND, NUMBER) KIND = NUMBER,
#include "warp/HandleKinds.inc"
};
/// Kinds are numbered from 1 to this.
inline constexpr uint8_t lastGeometryKind = 0
#define WARP_HANDLE_KIND(KIND, NUMBER) +1
#include "warp/HandleKinds.inc"
    ;

namespace geometry {
class Slot;
}

/// Words of 64 bits that a handle leads to; the first says whose they are.
inline constexpr size_t handleWords = 32;

/// Memory that a handle's words lead to.
struct HandleMemory {
  const void *data = nullptr;
  size_t bytes = 0;
};

/// A number for kernels that leads to 256 bytes on a device, of which the
/// first eight say whose they are; it is dead when this object is gone.
class WARP_API GeometryHandle {
public:
  GeometryHandle(GeometryKind kind, int device);
  ~GeometryHandle();

  uint64_t id() const;
  GeometryKind kind() const;
  /// Writes what follows the first eight bytes, at most 248. `memory`: what is
  /// reached from there, but for arrays with descriptors among the words.
  void write(const void *contents, size_t bytes,
             std::vector<HandleMemory> memory = {});

private:
  std::unique_ptr<geometry::Slot> slot;
};

/// The defect of the handle of an object that should be alive on a
/// device, such as "the id of a freed Mesh"; empty if nothing is. A Mesh is
/// a Bvh, too.
WARP_API std::string describeHandle(uint64_t id, GeometryKind kind, int device);

/// Writes word `index`, from 1 to 31, of what a live handle leads to.
WARP_API void writeHandleWord(uint64_t id, unsigned index, uint64_t value);

/// The kind of the object of a handle; empty if none is alive on the
/// device.
WARP_API std::optional<GeometryKind> findHandle(uint64_t id, int device);

/// The words of a handle, as something else may take them over.
struct HandleContents {
  /// A word that is an address, and the memory around it that matters: empty
  /// for a null pointer.
  struct Pointer {
    uint32_t word;
    uint64_t begin, end;
  };
  GeometryKind kind;
  std::array<uint64_t, handleWords> words;
  std::vector<Pointer> pointers;
};

/// Waits for what may write them. Throws if no object of that handle lives.
WARP_API HandleContents readHandle(uint64_t id);
/// The words that are addresses, in ascending order.
WARP_API std::vector<uint32_t> pointerWords(GeometryKind kind);
/// The address of the words of a handle, on its device.
WARP_API uint64_t handleAddress(uint64_t id);

} // namespace warp

#endif // WARP_HANDLE_H

//===- Memory.h - Allocation, copies and fills ------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Memory of any device by pointer and device number. Work on CUDA memory is
// queued on a stream (null: the device's current one); copies that end in
// pageable host memory have finished on return. A request that cannot be met
// is an `Error` of kind `Memory` that names request and free memory.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_MEMORY_H
#define WARP_MEMORY_H

#include "warp/Device.h"
#include "warp/Export.h"
#include "warp/Launch.h"

#include <cstddef>
#include <string>

namespace warp {

/// Memory with an owner.
class WARP_API Buffer {
public:
  /// `pinned`: page-locked host memory that CUDA devices reach directly;
  /// plain memory where there is no CUDA.
  /// `stream`: that work on it is queued on first.
  Buffer(int device, size_t size, bool pinned = false,
         const Stream *stream = nullptr);
  ~Buffer();
  Buffer(const Buffer &) = delete;
  Buffer &operator=(const Buffer &) = delete;

  void *data() const { return memory; }
  size_t size() const { return bytes; }
  int device() const { return deviceIndex; }
  bool pinned() const { return kind == MemoryKind::Pinned; }
  /// Enters the memory in the tracker, with the place that asked for it.
  void track(const std::string &site);

private:
  void *memory = nullptr;
  size_t bytes;
  int deviceIndex;
  MemoryKind kind = MemoryKind::Unknown;
  bool tracked = false;
};

WARP_API void copyMemory(void *dst, int dstDevice, const void *src,
                         int srcDevice, size_t bytes,
                         const Stream *stream = nullptr);
/// The same from memory of the host, and to it.
inline void upload(void *dst, int device, const void *src, size_t bytes,
                   const Stream *stream = nullptr) {
  copyMemory(dst, device, src, cpuDevice, bytes, stream);
}
inline void download(void *dst, const void *src, int device, size_t bytes,
                     const Stream *stream = nullptr) {
  copyMemory(dst, cpuDevice, src, device, bytes, stream);
}
WARP_API void setMemory(void *dst, int device, int byte, size_t bytes,
                        const Stream *stream = nullptr);
/// Zeroes memory that nobody uses yet. While a graph is being captured that
/// happens at once and is no part of the graph.
WARP_API void clearNewMemory(void *memory, int device, size_t bytes);
/// The same with bytes of the host, which are read before this returns.
WARP_API void writeNewMemory(void *memory, int device, const void *contents,
                             size_t bytes);
/// Writes memory that launches queued before may use: after them, and no part
/// of a graph.
WARP_API void changeMemory(void *memory, int device, const void *contents,
                           size_t bytes);
/// Writes `count` copies of a pattern of `size` bytes.
WARP_API void fillMemory(void *dst, int device, const void *pattern,
                         size_t size, size_t count,
                         const Stream *stream = nullptr);

/// A strided view as copies see it, of memory of the host unless said.
struct ArrayView {
  const ArrayDescriptor *array;
  int device = cpuDevice;
};

/// True if the elements lie packed in row-major order.
WARP_API bool isContiguous(const ArrayDescriptor &array, size_t elementSize);
/// The mask of `ArrayFact` for an array with elements of that size.
WARP_API int32_t arrayFacts(const ArrayDescriptor &array, size_t elementSize);
/// Copies between views of equal shape, whatever their strides and devices.
WARP_API void copyArray(ArrayView dst, ArrayView src, size_t elementSize,
                        const Stream *stream = nullptr);
/// Sets every element to a pattern of `elementSize` bytes.
WARP_API void fillArray(ArrayView dst, const void *pattern, size_t elementSize,
                        const Stream *stream = nullptr);

} // namespace warp

#endif // WARP_MEMORY_H

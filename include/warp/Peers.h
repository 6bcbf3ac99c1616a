//===- Peers.h - Peer access, memory pools, shared memory -------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Access of one CUDA device to the memory of another one, the settings of the
// memory pools, managed memory and memory of other processes.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_PEERS_H
#define WARP_PEERS_H

#include "warp/Device.h"
#include "warp/Export.h"

#include <cstdint>
#include <utility>

namespace warp {

/// True if the hardware lets `peer` reach the memory of `device`.
WARP_API bool canPeersLink(int device, int peer);
/// Access of `peer` to memory of `device` that comes from no pool.
WARP_API bool isPeerAccessEnabled(int device, int peer);
WARP_API void setPeerAccessEnabled(int device, int peer, bool enable);
/// Access of `peer` to the memory pool of `device`.
WARP_API bool isPoolAccessEnabled(int device, int peer);
WARP_API void setPoolAccessEnabled(int device, int peer, bool enable);

/// True if memory that belongs to `owner` can be used by kernels on `device`.
WARP_API bool canAccess(int device, int owner, const void *memory);

/// True if new memory comes from the device's pool.
WARP_API bool isPoolEnabled(int device);
WARP_API void setPoolEnabled(int device, bool enable);
/// Bytes that the pool keeps when they are freed.
WARP_API uint64_t poolReleaseThreshold(int device);
WARP_API void setPoolReleaseThreshold(int device, uint64_t bytes);
/// Bytes in use from the pool, now and at most so far.
WARP_API std::pair<uint64_t, uint64_t> poolUse(int device);

WARP_API MemoryKind memoryKind(int device, const void *memory);

/// Memory that all devices and the host reach, by moving pages.
WARP_API void *allocateManaged(int device, size_t bytes);
/// Waits for the device, then frees.
WARP_API void freeManaged(int device, void *memory);

/// For memory that comes from no pool: a handle of the whole allocation, and
/// how far into it `memory` is.
WARP_API std::pair<IpcHandle, uint64_t> exportMemory(int device,
                                                     const void *memory);
WARP_API void *importMemory(int device, const IpcHandle &handle);
WARP_API void closeImported(int device, void *memory);

} // namespace warp

#endif // WARP_PEERS_H

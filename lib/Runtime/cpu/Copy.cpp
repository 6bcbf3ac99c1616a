//===- Copy.cpp - Copies and fills on the host ----------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Work on many bytes is spread over the thread pool. A strided copy is a loop
// nest around runs of bytes.
//
//===----------------------------------------------------------------------===//

#include "Device.h"
#include "GraphImpl.h"
#include "warp/ThreadPool.h"

#include <algorithm>
#include <cstring>
#include <string>
#include <vector>

using namespace warp;

/// Bytes that one thread copies or fills at a time.
static constexpr int64_t hostGrain = int64_t(512) << 10;

//===----------------------------------------------------------------------===//
// Copies
//===----------------------------------------------------------------------===//

static void copyHost(void *dst, const void *src, size_t bytes) {
  auto *to = static_cast<char *>(dst);
  auto *from = static_cast<const char *>(src);
  if (to < from + bytes && from < to + bytes) {
    std::memmove(to, from, bytes);
    return;
  }
  ThreadPool::parallelFor(0, bytes, hostGrain, [&](int64_t begin, int64_t end) {
    std::memcpy(to + begin, from + begin, end - begin);
  });
}

void CpuDevice::copy(void *dst, Device &, const void *src, Device &,
                     size_t bytes, const Stream *) {
  recordOrRun(bytes, [=] { copyHost(dst, src, bytes); });
}

template <int64_t Run>
static void copyRow(char *dst, const char *src, const CopyNest::Dimension &dim,
                    int64_t run) {
  for (int64_t i = 0; i < dim.extent; ++i)
    std::memcpy(dst + i * dim.dstStride, src + i * dim.srcStride,
                Run ? Run : run);
}

static void copyRow(char *dst, const char *src, const CopyNest::Dimension &dim,
                    int64_t run) {
  switch (run) {
  case 1:
    return copyRow<1>(dst, src, dim, run);
  case 2:
    return copyRow<2>(dst, src, dim, run);
  case 4:
    return copyRow<4>(dst, src, dim, run);
  case 8:
    return copyRow<8>(dst, src, dim, run);
  case 12:
    return copyRow<12>(dst, src, dim, run);
  case 16:
    return copyRow<16>(dst, src, dim, run);
  default:
    return copyRow<0>(dst, src, dim, run);
  }
}

static void copyNest(const CopyNest &nest, int level, char *dst,
                     const char *src) {
  const CopyNest::Dimension &dim = nest.dims[level];
  if (level == nest.rank - 1)
    return copyRow(dst, src, dim, nest.run);
  for (int64_t i = 0; i < dim.extent; ++i)
    copyNest(nest, level + 1, dst + i * dim.dstStride, src + i * dim.srcStride);
}

static void copyOnHost(const CopyNest &nest) {
  int64_t inner = nest.run;
  for (int i = 1; i < nest.rank; ++i)
    inner *= nest.dims[i].extent;
  int64_t grain = (int64_t(64) << 10) / inner + 1;
  const CopyNest::Dimension &outer = nest.dims[0];
  ThreadPool::parallelFor(
      0, outer.extent, grain, [&](int64_t begin, int64_t end) {
        CopyNest part = nest;
        part.dims[0].extent = end - begin;
        copyNest(part, 0, nest.dst + begin * outer.dstStride,
                 nest.src + begin * outer.srcStride);
      });
}

void CpuDevice::copyStrided(const CopyNest &nest, size_t bytes,
                            const Stream *) {
  recordOrRun(bytes, [=] { copyOnHost(nest); });
}

//===----------------------------------------------------------------------===//
// Fills
//===----------------------------------------------------------------------===//

static void fillHost(char *dst, const char *pattern, size_t size,
                     size_t count) {
  // Each thread first builds a block of whole patterns, then copies it.
  size_t perBlock = std::max<size_t>(1, 4096 / size);
  std::string block;
  for (size_t i = 0; i < perBlock; ++i)
    block.append(pattern, size);
  ThreadPool::parallelFor(0, count, hostGrain / static_cast<int64_t>(size) + 1,
                          [&](int64_t begin, int64_t end) {
                            char *to = dst + begin * size;
                            for (size_t left = (end - begin) * size;
                                 left > 0;) {
                              size_t part = std::min(left, block.size());
                              std::memcpy(to, block.data(), part);
                              to += part;
                              left -= part;
                            }
                          });
}

static void setHost(void *dst, int byte, size_t bytes) {
  auto *to = static_cast<char *>(dst);
  ThreadPool::parallelFor(0, bytes, hostGrain, [&](int64_t begin, int64_t end) {
    std::memset(to + begin, byte, end - begin);
  });
}

void CpuDevice::fill(void *dst, const void *pattern, size_t size, size_t count,
                     const Stream *) {
  auto *bytes = static_cast<const char *>(pattern);
  if (shortestPeriod(bytes, size) == 1)
    return recordOrRun(size * count, [=, byte = bytes[0]] {
      setHost(dst, byte, size * count);
    });
  auto *to = static_cast<char *>(dst);
  std::string own(bytes, size);
  recordOrRun(size * count, [=] { fillHost(to, own.data(), size, count); });
}

void CpuDevice::fillStrided(const ArrayDescriptor &dst, const void *pattern,
                            size_t elementSize, const Stream *) {
  // One element that every source stride of zero repeats.
  ArrayDescriptor source = dst;
  std::fill(source.strides, source.strides + maxRank, 0);
  auto *bytes = static_cast<const char *>(pattern);
  std::vector<char> own(bytes, bytes + elementSize);
  recordOrRun(countElements(dst) * elementSize, [=]() mutable {
    source.data = own.data();
    copyOnHost(simplifyCopy(dst, source, elementSize));
  });
}

void CpuDevice::initialize(void *dst, const void *contents, size_t bytes,
                           const Stream *) {
  contents ? copyHost(dst, contents, bytes) : setHost(dst, 0, bytes);
}

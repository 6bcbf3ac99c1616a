//===- Copy.cpp - Copies and fills of strided arrays ----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A copy between two views is first brought to its simplest form: dimensions
// of extent one go away, neighbours that are packed on both sides become one,
// and what is packed at the end becomes a run of bytes. What is left is a
// short list of dimensions around a run.
//
// On the host that is a loop nest. On CUDA many runs are a kernel's work
// (CopyKernel.cpp); of few, the last dimension is one two-dimensional copy of
// the driver and the others are loops around it. Views
// of two memories never meet directly: a strided side is packed into a
// temporary first, or unpacked from one, so that what travels is contiguous.
//
//===----------------------------------------------------------------------===//

#include "CopyNest.h"
#include "cuda/Device.h"
#include "GraphImpl.h"
#include "warp/Error.h"
#include "warp/Memory.h"
#include "warp/ThreadPool.h"

#include <algorithm>
#include <cstring>
#include <optional>
#include <string>
#include <vector>

using namespace warp;
using cuda::Pointer;

using Nest = CopyNest;
using Dimension = CopyNest::Dimension;

static std::string shapeText(const ArrayDescriptor &array) {
  std::string text = "(";
  for (int i = 0; i < array.ndim; ++i)
    text += (i ? ", " : "") + std::to_string(array.shape[i]);
  return text + (array.ndim == 1 ? ",)" : ")");
}

static int64_t elementCount(const ArrayDescriptor &array) {
  int64_t count = 1;
  for (int i = 0; i < array.ndim; ++i)
    count *= array.shape[i];
  return count;
}

bool warp::isContiguous(const ArrayDescriptor &array, size_t elementSize) {
  int64_t expected = static_cast<int64_t>(elementSize);
  for (int i = array.ndim - 1; i >= 0; --i) {
    if (array.shape[i] != 1 && array.strides[i] != expected)
      return elementCount(array) == 0;
    expected *= array.shape[i];
  }
  return true;
}

static Nest simplify(const ArrayDescriptor &dst, const ArrayDescriptor &src,
                     int64_t elementSize) {
  Nest nest{static_cast<char *>(dst.data),
            static_cast<char *>(src.data),
            elementSize,
            0,
            {}};
  // From the last dimension outwards; `dims` is turned around at the end.
  for (int i = dst.ndim - 1; i >= 0; --i) {
    Dimension next{dst.shape[i], dst.strides[i], src.strides[i]};
    if (next.extent == 1)
      continue;
    if (nest.rank == 0 && next.dstStride == nest.run &&
        next.srcStride == nest.run) {
      nest.run *= next.extent;
      continue;
    }
    if (nest.rank > 0) {
      Dimension &last = nest.dims[nest.rank - 1];
      if (next.dstStride == last.dstStride * last.extent &&
          next.srcStride == last.srcStride * last.extent) {
        last.extent *= next.extent;
        continue;
      }
    }
    nest.dims[nest.rank++] = next;
  }
  std::reverse(nest.dims, nest.dims + nest.rank);
  return nest;
}

//===----------------------------------------------------------------------===//
// Host
//===----------------------------------------------------------------------===//

template <int64_t Run>
static void copyRow(char *dst, const char *src, const Dimension &dim,
                    int64_t run) {
  for (int64_t i = 0; i < dim.extent; ++i)
    std::memcpy(dst + i * dim.dstStride, src + i * dim.srcStride,
                Run ? Run : run);
}

static void copyRow(char *dst, const char *src, const Dimension &dim,
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

static void copyNest(const Nest &nest, int level, char *dst, const char *src) {
  const Dimension &dim = nest.dims[level];
  if (level == nest.rank - 1)
    return copyRow(dst, src, dim, nest.run);
  for (int64_t i = 0; i < dim.extent; ++i)
    copyNest(nest, level + 1, dst + i * dim.dstStride, src + i * dim.srcStride);
}

static void copyOnHost(const Nest &nest) {
  int64_t inner = nest.run;
  for (int i = 1; i < nest.rank; ++i)
    inner *= nest.dims[i].extent;
  int64_t grain = (int64_t(64) << 10) / inner + 1;
  const Dimension &outer = nest.dims[0];
  ThreadPool::parallelFor(
      0, outer.extent, grain, [&](int64_t begin, int64_t end) {
        Nest part = nest;
        part.dims[0].extent = end - begin;
        copyNest(part, 0, nest.dst + begin * outer.dstStride,
                 nest.src + begin * outer.srcStride);
      });
}

//===----------------------------------------------------------------------===//
// CUDA
//===----------------------------------------------------------------------===//

static void copyRowOnCuda(char *dst, const char *src, const Dimension &dim,
                          int64_t run, cuda::StreamHandle stream) {
  if (dim.dstStride >= run && dim.srcStride >= run) {
    cuda::Copy2D copy;
    copy.srcDevice = reinterpret_cast<Pointer>(src);
    copy.srcPitch = dim.srcStride;
    copy.dstDevice = reinterpret_cast<Pointer>(dst);
    copy.dstPitch = dim.dstStride;
    copy.widthInBytes = run;
    copy.height = dim.extent;
    return WARP_CUDA(memcpy2DAsync, &copy, stream);
  }
  // Broadcast or reversed rows are no pitch that the driver knows.
  for (int64_t i = 0; i < dim.extent; ++i)
    WARP_CUDA(memcpyDtoDAsync,
              reinterpret_cast<Pointer>(dst) + i * dim.dstStride,
              reinterpret_cast<Pointer>(src) + i * dim.srcStride, run, stream);
}

static void copyNestOnCuda(const Nest &nest, int level, char *dst,
                           const char *src, cuda::StreamHandle stream) {
  const Dimension &dim = nest.dims[level];
  if (level == nest.rank - 1)
    return copyRowOnCuda(dst, src, dim, nest.run, stream);
  for (int64_t i = 0; i < dim.extent; ++i)
    copyNestOnCuda(nest, level + 1, dst + i * dim.dstStride,
                   src + i * dim.srcStride, stream);
}

//===----------------------------------------------------------------------===//
// Any memory
//===----------------------------------------------------------------------===//

/// The same shape, packed, in other memory.
static ArrayDescriptor packedLike(const ArrayDescriptor &array,
                                  size_t elementSize, void *data) {
  ArrayDescriptor packed = array;
  packed.data = data;
  int64_t stride = static_cast<int64_t>(elementSize);
  for (int i = array.ndim - 1; i >= 0; --i) {
    packed.strides[i] = static_cast<int32_t>(stride);
    stride *= array.shape[i];
  }
  return packed;
}

/// Whether the bytes that two views span have any in common.
static bool overlap(const ArrayDescriptor &a, const ArrayDescriptor &b,
                    int64_t elementSize) {
  auto span = [&](const ArrayDescriptor &array) {
    auto low = reinterpret_cast<intptr_t>(array.data);
    intptr_t high = low + elementSize;
    for (int i = 0; i < array.ndim; ++i) {
      int64_t reach = int64_t(array.shape[i] - 1) * array.strides[i];
      (reach < 0 ? low : high) += reach;
    }
    return std::pair(low, high);
  };
  auto [aLow, aHigh] = span(a);
  auto [bLow, bHigh] = span(b);
  return aLow < bHigh && bLow < aHigh;
}

/// The stream, if it belongs to the device.
static const Stream *streamOn(int device, const Stream *stream) {
  return stream && stream->device() == device ? stream : nullptr;
}

static void checkShapes(const ArrayDescriptor &dst,
                        const ArrayDescriptor &src) {
  if (dst.ndim == src.ndim &&
      std::equal(dst.shape, dst.shape + dst.ndim, src.shape))
    return;
  throw Error(Error::Kind::Value, "copy expects arrays of one shape, but got " +
                                      shapeText(dst) + " and " +
                                      shapeText(src));
}

void warp::copyArray(ArrayView dst, ArrayView src, size_t elementSize,
                     const Stream *stream) {
  checkShapes(*dst.array, *src.array);
  size_t bytes = elementCount(*dst.array) * elementSize;
  if (bytes == 0)
    return;
  // Between devices what travels is noted: copies of bytes.
  std::optional<TraceScope> tracing;
  if (dst.device == src.device) {
    tracing.emplace(dst.device, stream);
    if (*tracing)
      (*tracing)->add(GraphOperation::Kind::CopyArray,
                      graphs::CopyArray{*dst.array, *src.array, elementSize});
  }
  Nest nest = simplify(*dst.array, *src.array, elementSize);
  if (nest.rank == 0)
    return copyMemory(nest.dst, dst.device, nest.src, src.device, bytes,
                      stream);
  auto through = [&](int device) {
    Buffer buffer(device, bytes, false, streamOn(device, stream));
    ArrayDescriptor packed = packedLike(*src.array, elementSize, buffer.data());
    copyArray({&packed, device}, src, elementSize, stream);
    copyArray(dst, {&packed, device}, elementSize, stream);
    // Pageable memory must outlive the copy that reads it; a graph keeps it.
    if (device == cpuDevice && dst.device != cpuDevice &&
        !isCapturing(dst.device))
      (stream ? stream : currentStream(dst.device).get())->synchronize();
  };
  if (dst.device != src.device)
    return through(isContiguous(*src.array, elementSize) ? dst.device
                                                         : src.device);
  if (overlap(*dst.array, *src.array, elementSize))
    return through(dst.device);
  if (dst.device == cpuDevice) {
    if (!recordOnHost(bytes, [=] { copyOnHost(nest); }))
      copyOnHost(nest);
    return;
  }
  if (copyByKernel(nest, dst.device, stream))
    return;
  QueuedWork work(dst.device, stream);
  copyNestOnCuda(nest, 0, nest.dst, nest.src, work.stream());
}

void warp::fillArray(ArrayView dst, const void *pattern, size_t elementSize,
                     const Stream *stream) {
  int64_t count = elementCount(*dst.array);
  if (count == 0)
    return;
  if (isContiguous(*dst.array, elementSize))
    return fillMemory(dst.array->data, dst.device, pattern, elementSize, count,
                      stream);
  TraceScope tracing(dst.device, stream);
  if (tracing)
    tracing->add(GraphOperation::Kind::FillArray, graphs::FillArray{*dst.array},
                 std::string(static_cast<const char *>(pattern), elementSize));
  if (dst.device == cpuDevice) {
    // One element that every source stride of zero repeats.
    ArrayDescriptor source = *dst.array;
    std::fill(source.strides, source.strides + maxRank, 0);
    auto *bytes = static_cast<const char *>(pattern);
    std::vector<char> own(bytes, bytes + elementSize);
    auto fill = [=, dst = *dst.array]() mutable {
      source.data = own.data();
      copyOnHost(simplify(dst, source, elementSize));
    };
    if (!recordOnHost(count * elementSize, fill))
      fill();
    return;
  }
  Buffer buffer(dst.device, count * elementSize, false, stream);
  fillMemory(buffer.data(), dst.device, pattern, elementSize, count, stream);
  ArrayDescriptor packed = packedLike(*dst.array, elementSize, buffer.data());
  copyArray(dst, {&packed, dst.device}, elementSize, stream);
}

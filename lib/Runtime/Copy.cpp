//===- Copy.cpp - Copies and fills of strided arrays ----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A copy between two views is first brought to its simplest form: dimensions
// of extent one go away, neighbours that are packed on both sides become one,
// and packed dimensions at the end become a run of bytes. A short list of
// dimensions around a run is left.
//
// The device copies that (cpu/Copy.cpp, cuda/Copy.cpp). Views of two memories
// are never copied directly: a strided side is packed into a temporary first,
// or unpacked from one, so that what travels is contiguous.
//
//===----------------------------------------------------------------------===//

#include "Device.h"
#include "GraphImpl.h"
#include "LaunchQueue.h"
#include "warp/Error.h"
#include "warp/Memory.h"

#include <algorithm>
#include <cstring>
#include <optional>
#include <string>

using namespace warp;

using Nest = CopyNest;
using Dimension = CopyNest::Dimension;

static std::string shapeText(const ArrayDescriptor &array) {
  std::string text = "(";
  for (int i = 0; i < array.ndim; ++i)
    text += (i ? ", " : "") + std::to_string(array.shape[i]);
  return text + (array.ndim == 1 ? ",)" : ")");
}

CopyNest warp::simplifyCopy(const ArrayDescriptor &dst,
                            const ArrayDescriptor &src, int64_t elementSize) {
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

ArrayDescriptor warp::packedLike(const ArrayDescriptor &array,
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

size_t warp::shortestPeriod(const char *pattern, size_t size) {
  for (size_t period : {1, 2, 4})
    if (size % period == 0 &&
        std::memcmp(pattern, pattern + period, size - period) == 0)
      return period;
  return size;
}

/// True if the bytes that two views span have any in common.
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
  size_t bytes = countElements(*dst.array) * elementSize;
  if (bytes == 0)
    return;
  if (dst.device == src.device &&
      queueCall(dst.device, stream,
                [=, to = *dst.array, from = *src.array,
                 device = dst.device](const Stream *where) {
                  copyArray({&to, device}, {&from, device}, elementSize, where);
                }))
    return;
  // Between devices what travels is noted: copies of bytes.
  std::optional<TraceScope> tracing;
  if (dst.device == src.device) {
    tracing.emplace(dst.device, stream);
    if (*tracing)
      (*tracing)->add(GraphOperation::Kind::CopyArray,
                      graphs::CopyArray{*dst.array, *src.array, elementSize});
  }
  Nest nest = simplifyCopy(*dst.array, *src.array, elementSize);
  // The driver's copies of bytes may not overlap.
  bool meets = dst.device == src.device &&
               (nest.rank != 0 || !isHost(dst.device)) &&
               overlap(*dst.array, *src.array, elementSize);
  if (nest.rank == 0 && !meets)
    return copyMemory(nest.dst, dst.device, nest.src, src.device, bytes,
                      stream);
  auto through = [&](int device) {
    Buffer buffer(device, bytes, false, streamOn(device, stream));
    ArrayDescriptor packed = packedLike(*src.array, elementSize, buffer.data());
    copyArray({&packed, device}, src, elementSize, stream);
    copyArray(dst, {&packed, device}, elementSize, stream);
    // Pageable memory must outlive the copy that reads it; a graph keeps it.
    if (isHost(device) && !isHost(dst.device) && !isCapturing(dst.device))
      (stream ? stream : currentStream(dst.device).get())->synchronize();
  };
  if (dst.device != src.device)
    return through(isContiguous(*src.array, elementSize) ? dst.device
                                                         : src.device);
  if (meets)
    return through(dst.device);
  deviceAt(dst.device).copyStrided(nest, bytes, stream);
}

void warp::fillArray(ArrayView dst, const void *pattern, size_t elementSize,
                     const Stream *stream) {
  int64_t count = countElements(*dst.array);
  if (count == 0)
    return;
  if (isContiguous(*dst.array, elementSize))
    return fillMemory(dst.array->data, dst.device, pattern, elementSize, count,
                      stream);
  auto bytes = [&] {
    return std::string(static_cast<const char *>(pattern), elementSize);
  };
  if (mustQueue() && queueCall(dst.device, stream,
                               [=, array = *dst.array, device = dst.device,
                                kept = bytes()](const Stream *where) {
                                 fillArray({&array, device}, kept.data(),
                                           elementSize, where);
                               }))
    return;
  TraceScope tracing(dst.device, stream);
  if (tracing)
    tracing->add(GraphOperation::Kind::FillArray, graphs::FillArray{*dst.array},
                 bytes());
  deviceAt(dst.device).fillStrided(*dst.array, pattern, elementSize, stream);
}

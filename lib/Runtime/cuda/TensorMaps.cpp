//===- TensorMaps.cpp - Tensor maps of a launch ---------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "TensorMaps.h"

#include "Device.h"
#include "warp/Launch.h"

#include <algorithm>
#include <cstring>

using namespace warp;

/// Rows begin at multiples of so many bytes.
static constexpr int32_t rowAlignment = 16;

static ArrayDescriptor descriptorOf(const TensorMap &map, const void *params) {
  ArrayDescriptor array;
  std::memcpy(&array, static_cast<const char *>(params) + map.descriptor,
              sizeof(array));
  return array;
}

bool CudaDevice::canMap(const std::vector<TensorMap> &maps,
                        const void *params) {
  return cuda::driver()->encodeTensorMap &&
         std::all_of(maps.begin(), maps.end(), [&](const TensorMap &map) {
           ArrayDescriptor array = descriptorOf(map, params);
           return reinterpret_cast<uintptr_t>(array.data) % rowAlignment == 0 &&
                  array.shape[0] > 0 && array.shape[1] > 0 &&
                  array.strides[1] == map.elementBytes &&
                  array.strides[0] > 0 && array.strides[0] % rowAlignment == 0;
         });
}

/// The driver's names for what boxes are like.
enum : int {
  elementsOf16Bits = 1,
  floatsOf32Bits = 7,
  notInterleaved = 0,
  notSwizzled = 0,
  swizzleOver32Bytes = 1,
  swizzleOver64Bytes = 2,
  swizzleOver128Bytes = 3,
  fetchLinesOf128Bytes = 2,
  zeroOutside = 0,
};

static void encode(const TensorMap &map, const void *params, void *to) {
  ArrayDescriptor array = descriptorOf(map, params);
  uint64_t extents[] = {uint64_t(array.shape[1]), uint64_t(array.shape[0])};
  uint64_t strides[] = {uint64_t(array.strides[0])};
  uint32_t box[] = {uint32_t(map.columns), uint32_t(map.rows)};
  uint32_t every[] = {1, 1};
  int type = map.elementBytes == 2 ? elementsOf16Bits : floatsOf32Bits;
  int swizzle = map.swizzle == 128  ? swizzleOver128Bytes
                : map.swizzle == 64 ? swizzleOver64Bytes
                : map.swizzle == 32 ? swizzleOver32Bytes
                                    : notSwizzled;
  WARP_CUDA(encodeTensorMap, to, type, 2, array.data, extents, strides, box,
            every, notInterleaved, swizzle, fetchLinesOf128Bytes, zeroOutside);
}

MappedParameters::MappedParameters(const std::vector<TensorMap> &maps,
                                   const void *params, size_t size)
    : block((maps.empty() ? size : maps.back().place + tensorMapBytes) +
            tensorMapAlignment) {
  auto start = reinterpret_cast<uintptr_t>(block.data());
  first = block.data() + (tensorMapAlignment - start % tensorMapAlignment) %
                             tensorMapAlignment;
  std::memcpy(first, params, size);
  for (const TensorMap &map : maps)
    encode(map, params, first + map.place);
}

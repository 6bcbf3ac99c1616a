//===- ExactSums.cpp - Launches with exact sums ---------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A launch with exact sums (include/warp/ExactSums.h) is three steps: memory
// for the digits is cleared, the kernel adds to them, and another kernel rounds
// (RoundSums.cpp). On a CUDA device all three are queued, or captured. On the
// CPU the memory is promised by the system and comes, cleared, as digits are
// touched: of the 75 of a double four or five.
//
//===----------------------------------------------------------------------===//

#include "ExactSums.h"

#include "Overlap.h"
#include "Support.h"
#include "warp/Memory.h"

#include <algorithm>
#include <cstring>
#include <sys/mman.h>

using namespace warp;

/// Numbers of one array; so the extents and strides that describe its digits
/// have 32 bits.
static constexpr int64_t maxNumbers = int64_t(1) << 27;

/// Memory of the host that is worth a request to the system.
static constexpr size_t manyBytes = size_t(256) << 10;

static ArrayDescriptor descriptorOf(const SummedArray &array,
                                    const void *params) {
  ArrayDescriptor descriptor;
  std::memcpy(&descriptor, static_cast<const char *>(params) + array.descriptor,
              sizeof(descriptor));
  return descriptor;
}

static AddressRange addressesOf(const SummedArray &array, const void *params) {
  ArrayDescriptor descriptor = descriptorOf(array, params);
  return rangeOf(array.gradient ? descriptor.grad : descriptor.data, descriptor,
                 array.elementSize, array.strideScale);
}

bool warp::overlap(const std::vector<SummedArray> &arrays, const void *params) {
  for (const SummedArray &sum : arrays) {
    if (!sum.width)
      continue;
    AddressRange own = addressesOf(sum, params);
    for (const SummedArray &other : arrays)
      if (!other.width && own.overlaps(addressesOf(other, params)))
        return true;
  }
  return false;
}

/// Words that hold what was touched.
static int64_t wordsOfMarks(int width) { return (countMarks(width) + 1) / 2; }

/// Words that hold the digits of a sum, too.
static int64_t wordsOf(int width, int64_t count) {
  return wordsOfMarks(width) + (countDigits(width) + 1) * count;
}

static void checkArray(const std::string &kernel, const SummedArray &array,
                       const void *params, int64_t count) {
  ArrayDescriptor descriptor = descriptorOf(array, params);
  auto reject = [&](const std::string &message) {
    throw Error(Error::Kind::LaunchValue,
                "launch('" + kernel + "'): deterministic sums into an array " +
                    message);
  };
  if (count > maxNumbers)
    reject("expect at most 2^27 floats from its first to its last one, but "
           "got " +
           std::to_string(count));
  for (int i = 0; i < descriptor.ndim; ++i)
    if (descriptor.shape[i] > 1 &&
        descriptor.strides[i] * array.strideScale % (array.width / 8) != 0)
      reject("of " + std::to_string(array.width) +
             "-bit floats expect strides that are multiples of " +
             std::to_string(array.width / 8) + " bytes, but got " +
             std::to_string(descriptor.strides[i]));
}

ExactSums::ExactSums(const std::string &kernel, int device,
                     const std::vector<SummedArray> &arrays, const void *params,
                     size_t paramSize, const Stream *stream)
    : device(device), stream(stream), block(paramSize / 8) {
  std::memcpy(block.data(), params, paramSize);
  int64_t words = 0;
  for (const SummedArray &array : arrays) {
    if (!array.width)
      break;
    int width = static_cast<int>(array.width);
    AddressRange range = addressesOf(array, params);
    Sum sum{width, {}};
    sum.descriptor.base = range.begin;
    sum.descriptor.count = int64_t(range.end - range.begin) / (width / 8);
    checkArray(kernel, array, params, sum.descriptor.count);
    words += wordsOf(width, sum.descriptor.count);
    sums.push_back(sum);
  }
  int64_t *next = nullptr;
  try {
    next = static_cast<int64_t *>(allocate(words * 8));
  } catch (const Error &error) {
    throw Error(error.kind,
                "launch('" + kernel +
                    "'): memory for deterministic sums: " + error.message);
  }
  for (Sum &sum : sums) {
    SumDescriptor &descriptor = sum.descriptor;
    descriptor.touched = reinterpret_cast<int32_t *>(next);
    descriptor.digits = next + wordsOfMarks(sum.width);
    next += wordsOf(sum.width, descriptor.count);
    uint64_t fields[sizeof(SumDescriptor) / 8];
    std::memcpy(fields, &descriptor, sizeof(descriptor));
    block.insert(block.end(), std::begin(fields), std::end(fields));
  }
}

/// Large pages save most page faults.
void *ExactSums::allocate(size_t bytes) {
  if (!isHost(device)) {
    deviceMemory =
        std::make_unique<Buffer>(device, bytes, /*pinned=*/false, stream);
    setMemory(deviceMemory->data(), device, 0, bytes, stream);
    return deviceMemory->data();
  }
  if (bytes < manyBytes) {
    fewWords.resize(bytes / 8);
    return fewWords.data();
  }
  void *memory = mmap(nullptr, bytes, PROT_READ | PROT_WRITE,
                      MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED)
    throw Error(Error::Kind::Memory,
                "out of memory on 'cpu', requested " + formatBytes(bytes));
  pages.memory = memory;
  pages.bytes = bytes;
  madvise(memory, bytes, MADV_HUGEPAGE);
  return memory;
}

ExactSums::Pages::~Pages() {
  if (memory)
    munmap(memory, bytes);
}

void ExactSums::finish() {
  for (const Sum &sum : sums) {
    const SumDescriptor &descriptor = sum.descriptor;
    struct {
      LaunchHeader header;
      ArrayDescriptor out, digits, touched;
    } arguments;
    int32_t count = static_cast<int32_t>(descriptor.count);
    int32_t weights = countDigits(sum.width) + 1, size = sum.width / 8;
    auto describe = [](ArrayDescriptor &array, void *data, int32_t extent,
                       int32_t stride) {
      array.data = data;
      array.shape[array.ndim] = extent;
      array.strides[array.ndim++] = stride;
    };
    describe(arguments.out, reinterpret_cast<void *>(descriptor.base), count,
             size);
    describe(arguments.digits, descriptor.digits, weights, count * 8);
    describe(arguments.digits, descriptor.digits, count, 8);
    describe(arguments.touched, descriptor.touched, countMarks(sum.width), 4);
    LaunchDim dim;
    dim.extent[0] = count;
    roundingKernel(sum.width).launch(device, dim, &arguments, stream);
  }
}

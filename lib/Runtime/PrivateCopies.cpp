//===- PrivateCopies.cpp - Launches on privatized arrays ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "PrivateCopies.h"

#include "CopyNest.h"
#include "Support.h"
#include "warp/Error.h"
#include "warp/Memory.h"
#include "warp/ThreadPool.h"

#include <algorithm>
#include <chrono>
#include <cstring>
#include <limits>
#include <sys/mman.h>

using namespace warp;

/// Nanoseconds for a number of a copy: to add it, to clear it, and what the
/// caches lose to it; for one that a minimum or maximum is kept in, to fill it
/// as well. In memory that is new to the process, for its pages too.
static constexpr double mergeTime = 0.13;
static constexpr double fillTime = 0.1;
static constexpr double pageTime = 0.25;
/// Nanoseconds of two more loops of the pool.
static constexpr double startTime = 5e3;

/// Bytes that all copies of a launch may have, and that are kept after it.
static constexpr double mostBytes = double(size_t(512) << 20);
static constexpr size_t keptBytes = size_t(64) << 20;
static constexpr std::chrono::seconds idleTime{2};

/// Copies and their parts begin here, so that workers share no cache line.
static constexpr size_t alignment = 256;

/// Numbers that are worth handing to another thread.
static constexpr int64_t mergeGrain = 8192;

static size_t alignUp(size_t size, size_t unit) {
  return (size + unit - 1) / unit * unit;
}

static ArrayDescriptor descriptorOf(const CopiedArray &array,
                                    const void *params) {
  ArrayDescriptor descriptor;
  std::memcpy(&descriptor, static_cast<const char *>(params) + array.descriptor,
              sizeof(descriptor));
  return descriptor;
}

static int64_t placeOfPointer(const CopiedArray &array) {
  return array.descriptor + (array.gradient ? offsetof(ArrayDescriptor, grad)
                                            : offsetof(ArrayDescriptor, data));
}

UpdateMode warp::chooseUpdates(const CopiedArrays &copied, const void *params,
                               int64_t items) {
  double width = ThreadPool::size();
  double alone = copied.plainTime * static_cast<double>(items);
  double atomic = copied.atomicTime * static_cast<double>(items) / width;
  double merging = 0, numbers = 0, bytes = 0;
  bool packed = true;
  for (const CopiedArray &array : copied.list) {
    ArrayDescriptor descriptor = descriptorOf(array, params);
    int32_t facts = descriptor.flags;
    if (!(facts & arrayKnown))
      facts = arrayFacts(descriptor, array.elementSize);
    packed &= (facts & arrayPacked) != 0;
    int64_t count = countElements(descriptor) * array.numbers;
    double of = static_cast<double>(count) * (width - 1);
    numbers += of;
    merging +=
        of * (array.kind == CopyKind::sum ? mergeTime : mergeTime + fillTime);
    bytes += of * static_cast<double>(array.width / 8);
  }
  double paging = bytes > keptBytes ? numbers * pageTime : 0;
  double copies = alone / width + startTime + merging + paging;
  if (packed && bytes <= mostBytes && copies < std::min(alone, atomic))
    return UpdateMode::Copies;
  return alone <= atomic ? UpdateMode::Alone : UpdateMode::Atomic;
}

//===----------------------------------------------------------------------===//
// Memory
//===----------------------------------------------------------------------===//

namespace {

/// Memory that is zero between launches.
struct Arena {
  char *memory = nullptr;
  size_t bytes = 0;
  std::chrono::steady_clock::time_point lastUse;

  void free() {
    if (memory)
      munmap(memory, bytes);
    memory = nullptr;
    bytes = 0;
  }
};

} // namespace

static Arena arena;

void warp::forgetCopiesInChild() { arena = {}; }

void warp::freeIdleCopies() {
  if (arena.memory &&
      std::chrono::steady_clock::now() - arena.lastUse > idleTime)
    arena.free();
}

/// Large pages save most page faults.
static char *takeMemory(size_t bytes) {
  arena.lastUse = std::chrono::steady_clock::now();
  if (arena.bytes >= bytes)
    return arena.memory;
  arena.free();
  bytes = alignUp(bytes, size_t(2) << 20);
  void *memory = mmap(nullptr, bytes, PROT_READ | PROT_WRITE,
                      MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED)
    throw Error(Error::Kind::Memory,
                "out of memory on 'cpu', requested " + formatBytes(bytes));
  madvise(memory, bytes, MADV_HUGEPAGE);
  arena.memory = static_cast<char *>(memory);
  arena.bytes = bytes;
  return arena.memory;
}

//===----------------------------------------------------------------------===//
// One launch
//===----------------------------------------------------------------------===//

PrivateCopies::PrivateCopies(const CopiedArrays &copied, const void *params,
                             size_t paramSize)
    : params(params), paramSize(alignUp(paramSize, alignment)),
      workers(ThreadPool::size()) {
  for (const CopiedArray &array : copied.list) {
    ArrayDescriptor descriptor = descriptorOf(array, params);
    void *data = array.gradient ? descriptor.grad : descriptor.data;
    int64_t numbers = data ? countElements(descriptor) * array.numbers : 0;
    arrays.push_back({data, numbers, array.width, array.floating,
                      array.isUnsigned, array.kind, bytes});
    bytes = alignUp(bytes + numbers * (array.width / 8), alignment);
  }
  size_t others = workers.size() - 1;
  memory = takeMemory(bytes * others);
  blocks.resize(this->paramSize * others / sizeof(uint64_t));
  for (size_t i = 0; i < others; ++i) {
    char *block = reinterpret_cast<char *>(blocks.data()) + i * this->paramSize;
    std::memcpy(block, params, paramSize);
    for (size_t j = 0; j < arrays.size(); ++j) {
      // Code may ask whether there are gradients at all.
      if (!arrays[j].data)
        continue;
      char *copy = memory + i * bytes + arrays[j].offset;
      std::memcpy(block + placeOfPointer(copied.list[j]), &copy, sizeof(copy));
    }
  }
}

PrivateCopies::~PrivateCopies() {
  if (!isClear || arena.bytes > keptBytes)
    arena.free();
}

const void *PrivateCopies::paramsOf(int worker) {
  if (worker == 0)
    return params;
  if (!workers[worker].isUsed) {
    workers[worker].isUsed = true;
    fillCopies(worker);
  }
  return reinterpret_cast<char *>(blocks.data()) + (worker - 1) * paramSize;
}

/// Calls a function with a number of the type of an array's numbers, where it
/// matters signed.
template <typename Function>
static void withType(bool isFloating, bool isSigned, int64_t width,
                     Function function) {
  bool isWide = width == 64;
  if (isFloating)
    isWide ? function(double()) : function(float());
  else if (isSigned)
    isWide ? function(int64_t()) : function(int32_t());
  else
    isWide ? function(uint64_t()) : function(uint32_t());
}

/// The number that no minimum or maximum is changed by: that of NaN and a
/// number is the number.
template <typename T> static T neutral(CopyKind kind) {
  if constexpr (std::numeric_limits<T>::has_quiet_NaN)
    return std::numeric_limits<T>::quiet_NaN();
  return kind == CopyKind::min ? std::numeric_limits<T>::max()
                               : std::numeric_limits<T>::lowest();
}

/// Puts what changes nothing into a worker's copies; for sums it is there.
void PrivateCopies::fillCopies(int worker) {
  for (const Array &array : arrays) {
    if (array.kind == CopyKind::sum)
      continue;
    char *copy = memory + (worker - 1) * bytes + array.offset;
    withType(array.floating, !array.isUnsigned, array.width, [&](auto type) {
      using T = decltype(type);
      std::fill_n(reinterpret_cast<T *>(copy), array.numbers,
                  neutral<T>(array.kind));
    });
  }
}

/// Takes the minima, or maxima, of an array's numbers and those of a copy,
/// which it clears. NaN stands for no number, as in kernels.
template <typename T>
static void keepExtremes(T *array, T *copy, int64_t count, bool isMinimum) {
  auto keep = [&](auto isBetter) {
    for (int64_t i = 0; i < count; ++i) {
      T value = copy[i], old = array[i];
      array[i] = isBetter(value, old) || old != old ? value : old;
    }
  };
  if (isMinimum)
    keep([](T value, T old) { return value < old; });
  else
    keep([](T value, T old) { return value > old; });
  std::memset(copy, 0, size_t(count) * sizeof(T));
}

/// Adds numbers of a copy to those of an array and clears them; a line that the
/// launch did not touch stays out of it.
template <typename T>
static void addAndClear(T *array, T *copy, int64_t count) {
  constexpr int lineSize = 64 / sizeof(T);
  typedef T Line __attribute__((vector_size(64)));
  typedef uint64_t Words __attribute__((vector_size(64)));
  int64_t i = 0;
  for (; i + lineSize <= count; i += lineSize) {
    Words words;
    std::memcpy(&words, copy + i, sizeof(words));
    uint64_t any = 0;
    for (int word = 0; word < 8; ++word)
      any |= words[word];
    if (!any)
      continue;
    Line sum, line;
    std::memcpy(&line, copy + i, sizeof(line));
    std::memcpy(&sum, array + i, sizeof(sum));
    sum += line;
    std::memcpy(array + i, &sum, sizeof(sum));
    std::memset(copy + i, 0, sizeof(line));
  }
  for (; i < count; ++i) {
    if (copy[i] != 0)
      array[i] += copy[i];
    copy[i] = 0;
  }
}

template <typename T>
void PrivateCopies::mergeArray(const Array &array,
                               const std::vector<char *> &copies) {
  T *data = static_cast<T *>(array.data);
  auto combine = [&](int64_t begin, int64_t end) {
    // Pieces that stay in the first cache while all copies are combined.
    for (int64_t from = begin; from < end; from += 2048)
      for (char *copy : copies) {
        T *part = reinterpret_cast<T *>(copy + array.offset) + from;
        int64_t count = std::min<int64_t>(end - from, 2048);
        if (array.kind == CopyKind::sum)
          addAndClear(data + from, part, count);
        else
          keepExtremes(data + from, part, count, array.kind == CopyKind::min);
      }
  };
  ThreadPool::parallelFor(0, array.numbers, mergeGrain, combine);
}

void PrivateCopies::merge() {
  std::vector<char *> copies;
  for (size_t i = 1; i < workers.size(); ++i)
    if (workers[i].isUsed)
      copies.push_back(memory + (i - 1) * bytes);
  for (const Array &array : arrays) {
    if (copies.empty())
      break;
    // Integers wrap as they do in kernels, where they are added.
    bool isSigned = array.kind != CopyKind::sum && !array.isUnsigned;
    withType(array.floating, isSigned, array.width,
             [&](auto type) { mergeArray<decltype(type)>(array, copies); });
  }
  isClear = true;
}

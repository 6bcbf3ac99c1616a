//===- Scan.cpp - Prefix sums on the CPU ----------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The sequence is cut into blocks of a fixed length. The sum of a block starts
// at zero; what precedes the block is a sum of such sums. So a result depends
// on the numbers alone. By one thread, both sums are made in one pass; by
// several, the first pass makes the sums of blocks and the second the results.
//
//===----------------------------------------------------------------------===//

#include "Device.h"
#include "GraphImpl.h"
#include "warp/ThreadPool.h"

#include <vector>

using namespace warp;

/// Elements of a block.
static constexpr int64_t blockLength = 16384;

namespace {

/// The type that sums are kept in.
template <typename T> struct SumOf {
  using Type = T;
};
template <> struct SumOf<float> {
  using Type = double;
};
// Unsigned: sums wrap.
template <> struct SumOf<int32_t> {
  using Type = uint32_t;
};
template <> struct SumOf<int64_t> {
  using Type = uint64_t;
};

/// One component of a sequence.
template <typename T> struct Strided {
  char *data;
  int64_t stride;
  T &operator[](int64_t i) const {
    return *reinterpret_cast<T *>(data + i * stride);
  }
};

template <typename T> class Scan {
public:
  using Sum = typename SumOf<T>::Type;

  Scan(Strided<T> out, Strided<T> in, int64_t count, bool inclusive)
      : out(out), in(in), count(count), inclusive(inclusive) {}

  void run() const {
    int64_t blocks = (count + blockLength - 1) / blockLength;
    if (blocks == 1 || ThreadPool::size() == 1) {
      Sum before = 0;
      for (int64_t block = 0; block < blocks; ++block)
        before += write(block, before);
      return;
    }
    std::vector<Sum> sums(blocks);
    ThreadPool::parallelFor(0, blocks, 4, [&](int64_t begin, int64_t end) {
      for (int64_t block = begin; block < end; ++block)
        sums[block] = sumOf(block);
    });
    Sum before = 0;
    for (Sum &sum : sums) {
      Sum own = sum;
      sum = before;
      before += own;
    }
    ThreadPool::parallelFor(0, blocks, 4, [&](int64_t begin, int64_t end) {
      for (int64_t block = begin; block < end; ++block)
        write(block, sums[block]);
    });
  }

private:
  int64_t endOf(int64_t block) const {
    return std::min(count, (block + 1) * blockLength);
  }

  Sum sumOf(int64_t block) const {
    Sum sum = 0;
    for (int64_t i = block * blockLength; i < endOf(block); ++i)
      sum += static_cast<Sum>(in[i]);
    return sum;
  }

  /// Writes the results of a block and returns its sum.
  Sum write(int64_t block, Sum before) const {
    Sum sum = 0;
    for (int64_t i = block * blockLength; i < endOf(block); ++i) {
      Sum with = sum + static_cast<Sum>(in[i]);
      out[i] = static_cast<T>(before + (inclusive ? with : sum));
      sum = with;
    }
    return sum;
  }

  Strided<T> out, in;
  int64_t count;
  bool inclusive;
};

} // namespace

template <typename T>
static void scanOnHost(int width, Sequence out, Sequence in, int64_t count,
                       bool inclusive) {
  for (int i = 0; i < width; ++i) {
    int64_t offset = i * static_cast<int64_t>(sizeof(T));
    Scan<T>({static_cast<char *>(out.data) + offset, out.stride},
            {static_cast<char *>(in.data) + offset, in.stride}, count,
            inclusive)
        .run();
  }
}

static void scanOnHost(NumberType kind, int width, Sequence out, Sequence in,
                       int64_t count, bool inclusive) {
  switch (kind) {
  case NumberType::Int32:
  case NumberType::UInt32:
    return scanOnHost<int32_t>(width, out, in, count, inclusive);
  case NumberType::Float32:
    return scanOnHost<float>(width, out, in, count, inclusive);
  case NumberType::Int64:
  case NumberType::UInt64:
    return scanOnHost<int64_t>(width, out, in, count, inclusive);
  case NumberType::Float64:
    return scanOnHost<double>(width, out, in, count, inclusive);
  }
}

void CpuDevice::scan(NumberType kind, int width, Sequence out, Sequence in,
                     int64_t count, bool inclusive, const Stream *) {
  recordOrRun(count * width * sizeOf(kind),
              [=] { scanOnHost(kind, width, out, in, count, inclusive); });
}

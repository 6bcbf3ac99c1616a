//===- CopyKernel.cpp - Strided copies by generated kernels ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The driver copies rows; a transposed or scattered view has none worth the
// name. Such a copy is a launch of a kernel of ours, one thread per word: the
// run of bytes is divided into the largest words that all addresses allow, and
// the dimensions are put in the order of the destination, so that neighbouring
// threads write neighbouring words. One kernel per rank and word size is built
// when it is first needed.
//
//===----------------------------------------------------------------------===//

#include "CopyKernel.h"

#include "warp/Forks.h"
#include "warp/Kernel.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <string>

using namespace warp;

/// Runs below this number are left to the driver.
static constexpr int64_t fewRuns = 1024;

static const char *wordType(int64_t bytes) {
  switch (bytes) {
  case 1:
    return "ui8";
  case 2:
    return "ui16";
  case 4:
    return "ui32";
  case 8:
    return "ui64";
  default:
    return "!warp.vec<2 x ui64>";
  }
}

static std::string kernelText(int rank, int64_t word) {
  std::string type = wordType(word), indices, indexTypes;
  for (int i = 0; i < rank; ++i) {
    indices += (i ? ", %i" : "%i") + std::to_string(i);
    indexTypes += i ? ", si32" : "si32";
  }
  std::string array =
      "!warp.array<" + std::to_string(rank) + " x " + type + ">";
  return "func.func @copy_strided(%dst: " + array + ", %src: " + array +
         ") attributes {warp.kernel, warp.arg_names = [\"dst\", \"src\"]} {\n" +
         indices + " = warp.tid : " + indexTypes + "\n" +
         "%value = warp.load %src[" + indices + "] : " + array + ", " +
         indexTypes + " -> " + type + "\n" + "warp.store %value, %dst[" +
         indices + "] : " + type + ", " + array + ", " + indexTypes +
         "\nreturn\n}\n";
}

static Kernel &kernelFor(int rank, int64_t word) {
  static ForkMutex mutex;
  // Never destroyed: arrays may be copied while the process ends.
  static auto *kernels = new std::map<std::pair<int, int64_t>, Kernel>;
  std::lock_guard lock(mutex);
  auto found = kernels->find({rank, word});
  if (found == kernels->end())
    found = kernels
                ->try_emplace({rank, word},
                              Module::fromText(kernelText(rank, word)),
                              "copy_strided")
                .first;
  return found->second;
}

/// Largest power of two up to 16 that divides every address and the run.
static int64_t wordSize(const CopyNest &nest) {
  uint64_t bits = 16 | uint64_t(nest.run) |
                  reinterpret_cast<uintptr_t>(nest.dst) |
                  reinterpret_cast<uintptr_t>(nest.src);
  for (int i = 0; i < nest.rank; ++i)
    bits |= uint64_t(nest.dims[i].dstStride) | uint64_t(nest.dims[i].srcStride);
  return int64_t(bits & -bits);
}

bool warp::copyByKernel(const CopyNest &nest, int device,
                        const Stream *stream) {
  int64_t runs = 1;
  for (int i = 0; i < nest.rank; ++i)
    runs *= nest.dims[i].extent;
  if (runs < fewRuns)
    return false;
  int64_t word = wordSize(nest);
  CopyNest::Dimension dims[maxRank + 1];
  int rank = nest.rank;
  std::copy(nest.dims, nest.dims + rank, dims);
  std::sort(dims, dims + rank, [](const auto &a, const auto &b) {
    return std::abs(a.dstStride) > std::abs(b.dstStride);
  });
  if (nest.run != word)
    dims[rank++] = {nest.run / word, word, word};
  if (rank > maxRank)
    return false;
  if (copyTransposed(dims, rank, word, nest.dst, nest.src, device, stream))
    return true;

  struct {
    LaunchHeader header;
    ArrayDescriptor dst, src;
  } block;
  static_assert(sizeof(block) == firstArgument + 2 * sizeof(ArrayDescriptor));
  LaunchDim launch;
  launch.rank = block.dst.ndim = block.src.ndim = rank;
  block.dst.data = nest.dst;
  block.src.data = const_cast<char *>(nest.src);
  for (int i = 0; i < rank; ++i) {
    const CopyNest::Dimension &dim = dims[i];
    if (dim.extent > INT32_MAX || std::abs(dim.dstStride) > INT32_MAX ||
        std::abs(dim.srcStride) > INT32_MAX)
      return false;
    launch.extent[i] = dim.extent;
    block.dst.shape[i] = block.src.shape[i] = int32_t(dim.extent);
    block.dst.strides[i] = int32_t(dim.dstStride);
    block.src.strides[i] = int32_t(dim.srcStride);
  }
  kernelFor(rank, word).launch(device, launch, &block, stream);
  return true;
}

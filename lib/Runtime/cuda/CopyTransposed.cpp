//===- CopyTransposed.cpp - Transposed copies through registers -----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// If the destination is packed along one dimension and the source along
// another, one thread per word wastes most of every memory sector on one side.
// Here a thread moves a square tile of words whose sides are eight bytes long:
// it reads rows of the source, exchanges rows and columns by shifts in
// registers, and writes rows of the destination. A warp is eight tiles wide in
// the destination and four high, so that both sides touch whole sectors, and
// no shared memory is needed.
//
//===----------------------------------------------------------------------===//

#include "CopyKernel.h"

#include "warp/Forks.h"
#include "warp/Kernel.h"

#include <cstdlib>
#include <map>
#include <string>

using namespace warp;

/// Bytes of a tile's side.
static constexpr int64_t side = 8;
/// Tiles of a block beside and below each other. Blocks that run together lie
/// beside each other in the destination, which is what its memory likes best.
static constexpr int64_t tilesAcross = 8;
static constexpr int64_t tilesDown = 32;

static std::string constantText(const std::string &name, uint64_t number,
                                const std::string &type) {
  return name + " = warp.constant " + std::to_string(number) + " : " + type +
         "\n";
}

/// Word `row` of the result's row `column`: the word `column` of source row
/// `row`, put in its place by shifts.
static std::string wordText(int64_t row, int64_t column, int64_t bits) {
  std::string at = std::to_string(row) + "_" + std::to_string(column);
  std::string text;
  auto binary = [&](const std::string &name, const char *op,
                    const std::string &a, const std::string &b) {
    text += name + " = warp." + op + "(" + a + ", " + b +
            ") : (ui64, ui64) -> ui64\n";
  };
  binary("%down" + at, "rshift", "%row" + std::to_string(row),
         "%shift" + std::to_string(column));
  binary("%word" + at, "bit_and", "%down" + at, "%mask");
  binary("%up" + at, "lshift", "%word" + at, "%shift" + std::to_string(row));
  if (row == 0)
    return text;
  std::string before = std::to_string(row - 1) + "_" + std::to_string(column);
  binary("%sum" + at, "bit_or", (row == 1 ? "%up" : "%sum") + before,
         "%up" + at);
  return text;
}

/// The kernel for words of so many bits. Threads are (outer, block down, block
/// across and tile down in it, tile across in the block); arrays are (outer,
/// tile, row of the tile, position along it).
static std::string kernelText(int64_t bits) {
  const int64_t count = 8 * side / bits;
  const std::string array = "!warp.array<4 x ui64>",
                    four = ", si32, si32, si32, si32";
  std::string text =
      "func.func @copy_transposed(%dst: " + array + ", %src: " + array +
      ") attributes {warp.kernel, warp.arg_names = [\"dst\", \"src\"]} {\n"
      "%outer, %slab, %strip, %lane = warp.tid : si32, si32, si32, si32\n" +
      constantText("%wide", tilesAcross, "si32") +
      constantText("%high", tilesDown, "si32");
  auto binary = [&](const char *name, const char *op, const char *a,
                    const char *b, const char *result = "si32") {
    text += std::string(name) + " = warp." + op + "(" + a + ", " + b +
            ") : (si32, si32) -> " + result + "\n";
  };
  binary("%group", "div", "%strip", "%high");
  binary("%inner", "mod", "%strip", "%high");
  binary("%left", "mul", "%group", "%wide");
  binary("%across", "add", "%left", "%lane");
  binary("%top", "mul", "%slab", "%high");
  binary("%down", "add", "%top", "%inner");
  text += "%extent1 = warp.dim %src, 1 : " + array + " -> si32\n" +
          "%extent3 = warp.dim %src, 3 : " + array + " -> si32\n";
  binary("%fits1", "lt", "%across", "%extent1", "i1");
  binary("%fits3", "lt", "%down", "%extent3", "i1");
  text += "%exists = warp.bit_and(%fits1, %fits3) : (i1, i1) -> i1\n"
          "scf.if %exists {\n" +
          constantText("%mask",
                       bits == 64 ? ~uint64_t(0) : (uint64_t(1) << bits) - 1,
                       "ui64");
  for (int64_t i = 0; i < count; ++i) {
    std::string n = std::to_string(i);
    text += constantText("%shift" + n, i * bits, "ui64") +
            constantText("%at" + n, i, "si32") + "%row" + n +
            " = warp.load %src[%outer, %across, %at" + n +
            ", %down] : " + array + four + " -> ui64\n";
  }
  for (int64_t column = 0; column < count; ++column) {
    for (int64_t row = 0; row < count; ++row)
      text += wordText(row, column, bits);
    std::string n = std::to_string(column), last = std::to_string(count - 1);
    text += "warp.store " + ((count == 1 ? "%up" : "%sum") + last) + "_" + n +
            ", %dst[%outer, %down, %at" + n + ", %across] : ui64, " + array +
            four + "\n";
  }
  return text + "}\nreturn\n}\n";
}

static Kernel &kernelFor(int64_t word) {
  static ForkMutex mutex;
  // Never destroyed: arrays may be copied while the process ends.
  static auto *kernels = new std::map<int64_t, Kernel>;
  std::lock_guard lock(mutex);
  auto found = kernels->find(word);
  if (found == kernels->end())
    found = kernels
                ->try_emplace(word, Module::fromText(kernelText(8 * word)),
                              "copy_transposed")
                .first;
  return found->second;
}

/// Sets one dimension of both arrays.
static bool setDimension(ArrayDescriptor &array, int i, int64_t extent,
                         int64_t stride) {
  if (extent > INT32_MAX || std::abs(stride) > INT32_MAX)
    return false;
  array.shape[i] = int32_t(extent);
  array.strides[i] = int32_t(stride);
  return true;
}

bool warp::copyTransposed(const CopyNest::Dimension *dims, int rank,
                          int64_t word, char *dst, const char *src, int device,
                          const Stream *stream) {
  if (rank < 2 || rank > 3 || word > side)
    return false;
  const CopyNest::Dimension across = dims[rank - 1];
  if (across.dstStride != word)
    return false;
  int packed = 0;
  while (packed < rank - 1 && dims[packed].srcStride != word)
    ++packed;
  if (packed == rank - 1)
    return false;
  const CopyNest::Dimension down = dims[packed];
  const CopyNest::Dimension outer =
      rank == 2 ? CopyNest::Dimension{1, 0, 0} : dims[1 - packed];
  const int64_t count = side / word;
  uint64_t bits = reinterpret_cast<uintptr_t>(dst) |
                  reinterpret_cast<uintptr_t>(src) |
                  uint64_t(across.srcStride) | uint64_t(down.dstStride) |
                  uint64_t(outer.srcStride) | uint64_t(outer.dstStride);
  if (bits % side || across.extent % count || down.extent % count)
    return false;

  struct {
    LaunchHeader header;
    ArrayDescriptor dst, src;
  } block;
  block.dst.ndim = block.src.ndim = 4;
  block.dst.data = dst;
  block.src.data = const_cast<char *>(src);
  const int64_t acrossTiles = across.extent / count;
  const int64_t downTiles = down.extent / count;
  if (!setDimension(block.src, 0, outer.extent, outer.srcStride) ||
      !setDimension(block.src, 1, acrossTiles, count * across.srcStride) ||
      !setDimension(block.src, 2, count, across.srcStride) ||
      !setDimension(block.src, 3, downTiles, side) ||
      !setDimension(block.dst, 0, outer.extent, outer.dstStride) ||
      !setDimension(block.dst, 1, downTiles, count * down.dstStride) ||
      !setDimension(block.dst, 2, count, down.dstStride) ||
      !setDimension(block.dst, 3, acrossTiles, side))
    return false;
  const int64_t blocksAcross = (acrossTiles + tilesAcross - 1) / tilesAcross;
  const int64_t blocksDown = (downTiles + tilesDown - 1) / tilesDown;
  LaunchDim launch{
      4, {outer.extent, blocksDown, blocksAcross * tilesDown, tilesAcross}};
  kernelFor(word).launch(device, launch, &block, stream);
  return true;
}

//===- Codecs.cpp - Compression codecs of grid files ----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A grid packed by zip is one chunk, one packed by blosc has a chunk for each
// gigabyte; the size of a chunk is before it. Nothing is unpacked beyond what
// was said: a small file may unpack to anything.
//
//===----------------------------------------------------------------------===//

#include "Codecs.h"

#include "Layout.h"

#include "warp/Error.h"

#include <algorithm>
#include <dlfcn.h>
#include <limits>
#include <zlib.h>

using namespace warp;
using namespace warp::geometry;

/// Bytes that a chunk of blosc unpacks to at most.
static constexpr uint64_t bloscChunk = uint64_t(1) << 30;

static Error damaged(const std::string &why) {
  return Error(Error::Kind::Runtime, "the .nvdb file is damaged: " + why);
}

const uint8_t *Source::take(uint64_t count) {
  if (count > size - at)
    throw Error(Error::Kind::Runtime,
                "the .nvdb file ends after " + std::to_string(size) +
                    " bytes, but " + std::to_string(at) + " + " +
                    std::to_string(count) + " are needed");
  at += count;
  return bytes + at - count;
}

namespace {

/// The system's library, loaded when it is first needed.
struct Blosc {
  using Decompress = int (*)(const void *, void *, size_t, int);
  using Compress = int (*)(int, int, size_t, size_t, const void *, void *,
                           size_t, const char *, size_t, int);
  using Validate = int (*)(const void *, size_t, size_t *);

  Decompress decompress = nullptr;
  Compress compress = nullptr;
  Validate validate = nullptr;
};

struct Chunk {
  const uint8_t *bytes;
  uint64_t size;
};

} // namespace

static const Blosc &blosc() {
  static const Blosc loaded = [] {
    Blosc found;
    void *library = nullptr;
    for (const char *name : {"libblosc.so.1", "libblosc.so"})
      if (!library)
        library = dlopen(name, RTLD_NOW | RTLD_LOCAL);
    if (!library)
      return found;
    auto find = [&](auto &function, const char *name) {
      function = reinterpret_cast<std::decay_t<decltype(function)>>(
          dlsym(library, name));
    };
    find(found.decompress, "blosc_decompress_ctx");
    find(found.compress, "blosc_compress_ctx");
    find(found.validate, "blosc_cbuffer_validate");
    return found;
  }();
  if (!loaded.decompress || !loaded.compress || !loaded.validate)
    throw Error(Error::Kind::Runtime,
                "grids packed by blosc need the library libblosc.so.1 of "
                "version 1.16 or later, which cannot be loaded");
  return loaded;
}

static Chunk nextChunk(Source &source) {
  auto size = load<uint64_t>(source.take(sizeof(uint64_t)));
  return {source.take(size), size};
}

static Error otherSize(uint64_t size) {
  return damaged("a grid of " + std::to_string(size) +
                 " bytes unpacks to another size");
}

/// The largest count of one call of zlib.
static uInt countable(uint64_t bytes) {
  return uInt(std::min<uint64_t>(bytes, std::numeric_limits<uInt>::max()));
}

static void inflateTo(const Chunk &chunk, uint8_t *grid, uint64_t size) {
  z_stream stream{};
  if (inflateInit(&stream) != Z_OK)
    throw Error(Error::Kind::Memory, "out of memory for unpacking a grid");
  std::unique_ptr<z_stream, void (*)(z_stream *)> owner(
      &stream, [](z_stream *stream) { inflateEnd(stream); });
  uint64_t read = 0, written = 0;
  // One byte more shows that there would be more.
  uint8_t beyond;
  int status = Z_OK;
  while (status == Z_OK) {
    stream.next_in = const_cast<uint8_t *>(chunk.bytes) + read;
    uInt given = stream.avail_in = countable(chunk.size - read);
    stream.next_out = written < size ? grid + written : &beyond;
    uInt room = stream.avail_out =
        written < size ? countable(size - written) : 1;
    status = inflate(&stream, Z_NO_FLUSH);
    read += given - stream.avail_in;
    written += room - stream.avail_out;
    if (written > size)
      throw otherSize(size);
  }
  if (status != Z_STREAM_END && status != Z_BUF_ERROR)
    throw damaged(stream.msg ? stream.msg : "its zip stream is not one");
  if (written != size)
    throw otherSize(size);
}

static GridBytes unzipped(Source &source, uint64_t size) {
  // The largest size that zlib's format unpacks to.
  constexpr uint64_t mostPerByte = 1032;
  Chunk chunk = nextChunk(source);
  if (size / mostPerByte > chunk.size)
    throw damaged(std::to_string(chunk.size) + " bytes do not unpack to " +
                  std::to_string(size));
  GridBytes grid(size);
  inflateTo(chunk, grid.data(), size);
  return grid;
}

static GridBytes unbloscked(Source &source, uint64_t size) {
  const Blosc &library = blosc();
  // No memory before every chunk says that it has its share.
  std::vector<Chunk> chunks;
  for (uint64_t done = 0; done < size;) {
    Chunk chunk = nextChunk(source);
    uint64_t share = std::min(size - done, bloscChunk);
    size_t unpacked = 0;
    if (library.validate(chunk.bytes, chunk.size, &unpacked) < 0)
      throw damaged("a chunk is none of blosc");
    if (unpacked != share)
      throw otherSize(size);
    chunks.push_back(chunk);
    done += share;
  }
  GridBytes grid(size);
  uint64_t done = 0;
  for (const Chunk &chunk : chunks) {
    uint64_t share = std::min(size - done, bloscChunk);
    int count = library.decompress(chunk.bytes, grid.data() + done, share, 1);
    if (count < 0 || uint64_t(count) != share)
      throw damaged("a chunk of blosc cannot be unpacked");
    done += share;
  }
  return grid;
}

GridBytes warp::geometry::unpackGrid(Source &source, uint64_t size,
                                     uint64_t stored, GridCodec codec) {
  if (codec == GridCodec::Zip)
    return unzipped(source, size);
  if (codec == GridCodec::Blosc)
    return unbloscked(source, size);
  return GridBytes(source.take(stored), stored);
}

static void appendChunk(std::vector<uint8_t> &file, const uint8_t *bytes,
                        uint64_t size) {
  auto *count = reinterpret_cast<const uint8_t *>(&size);
  file.insert(file.end(), count, count + sizeof size);
  file.insert(file.end(), bytes, bytes + size);
}

static std::vector<uint8_t> zipped(const uint8_t *grid, size_t size) {
  std::vector<uint8_t> packed(compressBound(size)), file;
  uLongf length = packed.size();
  if (compress(packed.data(), &length, grid, size) != Z_OK)
    throw Error(Error::Kind::Memory, "out of memory for packing a grid");
  appendChunk(file, packed.data(), length);
  return file;
}

static std::vector<uint8_t> bloscked(const uint8_t *grid, size_t size) {
  // As NanoVDB packs: its strongest level of LZ4, floats shuffled.
  constexpr int level = 9, shuffle = 1, threads = 1;
  constexpr size_t overhead = 16, block = 1 << 18;
  const Blosc &library = blosc();
  std::vector<uint8_t> file;
  for (size_t done = 0; done < size; done += bloscChunk) {
    size_t share = std::min<size_t>(size - done, bloscChunk);
    std::vector<uint8_t> packed(share + overhead);
    int count =
        library.compress(level, shuffle, sizeof(float), share, grid + done,
                         packed.data(), packed.size(), "lz4", block, threads);
    if (count <= 0)
      throw Error(Error::Kind::Runtime, "blosc could not pack a grid");
    appendChunk(file, packed.data(), count);
  }
  return file;
}

std::vector<uint8_t> warp::geometry::packGrid(const uint8_t *grid, size_t size,
                                              GridCodec codec) {
  if (codec == GridCodec::Zip)
    return zipped(grid, size);
  if (codec == GridCodec::Blosc)
    return bloscked(grid, size);
  return std::vector<uint8_t>(grid, grid + size);
}

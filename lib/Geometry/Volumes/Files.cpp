//===- Files.cpp - .nvdb files --------------------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A header, what there is about each grid, then the grids, perhaps packed.
//
//===----------------------------------------------------------------------===//

#include "Codecs.h"
#include "Levels.h"
#include "Quantised.h"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <fstream>
#include <system_error>

using namespace warp;
using namespace warp::geometry;

namespace {

constexpr uint64_t fileMagics[] = {0x304244566F6E614E, 0x324244566F6E614E};

struct FileHeader {
  uint64_t magic;
  uint32_t version;
  uint16_t count, codec;
};
static_assert(sizeof(FileHeader) == 16);

/// A file's header of a grid; its name follows, with a zero.
struct AboutGrid {
  uint64_t size, fileSize, nameKey, voxels;
  uint32_t type, gridClass;
  double worldBox[6];
  int32_t indexBox[6];
  double voxelSize[3];
  uint32_t nameSize, nodeCounts[4], tileCounts[3];
  uint16_t codec, padding;
  uint32_t version;
};
static_assert(sizeof(AboutGrid) == 176);

} // namespace

static FileHeader fileHeaderOf(Source &source, size_t bytes) {
  auto notFound = [](const char *why) {
    return Error(Error::Kind::Runtime,
                 std::string("NanoVDB signature not found: ") + why);
  };
  if (bytes < sizeof(FileHeader))
    throw notFound("the file is too short");
  auto header = load<FileHeader>(source.take(sizeof(FileHeader)));
  if (header.magic != fileMagics[0] && header.magic != fileMagics[1])
    throw notFound("this is no .nvdb file");
  if (header.version >> 21 != majorVersion)
    throw Error(Error::Kind::Runtime,
                "Unsupported NanoVDB version " +
                    std::to_string(header.version >> 21) + ", but " +
                    std::to_string(majorVersion) + " is supported");
  if (header.codec > uint16_t(GridCodec::Blosc))
    throw Error(Error::Kind::Runtime,
                "Unsupported codec code: " + std::to_string(header.codec) +
                    " in the .nvdb file");
  return header;
}

/// Checks grids of files for rules of the format that reading does not need.
static GridBytes checkedGrids(const GridBytes &grids, size_t count) {
  GridBytes whole = expandGrids(grids);
  size_t start = 0;
  bool areBreadthFirst = true;
  for (size_t i = 0; i < count; ++i) {
    Levels levels = checkedLevels(whole.data() + start, whole.size() - start);
    if (levels.size % gridAlignment)
      throw broken("its size of " + std::to_string(levels.size) +
                   " bytes is no multiple of " + std::to_string(gridAlignment));
    areBreadthFirst &= (levels.header.flags & isBreadthFirst) != 0;
    start += levels.size;
  }
  if (!areBreadthFirst)
    throw Error(Error::Kind::Runtime,
                "Unsupported NanoVDB tree layout: the nodes of a level do not "
                "follow each other");
  return whole;
}

GridBytes warp::readGrids(const void *file, size_t bytes) {
  Source source(static_cast<const uint8_t *>(file), bytes);
  FileHeader header = fileHeaderOf(source, bytes);
  std::vector<AboutGrid> abouts;
  for (int i = 0; i < header.count; ++i) {
    abouts.push_back(load<AboutGrid>(source.take(sizeof(AboutGrid))));
    source.skip(abouts.back().nameSize);
  }
  std::vector<GridBytes> grids;
  for (const AboutGrid &about : abouts)
    grids.push_back(unpackGrid(source, about.size, about.fileSize,
                               GridCodec(header.codec)));
  if (grids.empty())
    throw Error(Error::Kind::Runtime, "the .nvdb file has no grid");
  bool isOne = grids.size() == 1;
  return checkedGrids(isOne ? grids[0] : joinGrids(grids), grids.size());
}

static Error systemError(const std::string &path) {
  return Error(Error::Kind::Runtime,
               "'" + path + "': " + std::generic_category().message(errno));
}

GridBytes warp::readGridsOf(const std::string &path) {
  errno = 0;
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  if (!file)
    throw systemError(path);
  GridBytes bytes(size_t(std::max<std::streamoff>(file.tellg(), 0)));
  file.seekg(0);
  if (!file.read(reinterpret_cast<char *>(bytes.data()),
                 std::streamsize(bytes.size())))
    throw systemError(path);
  try {
    return readGrids(bytes.data(), bytes.size());
  } catch (const Error &error) {
    throw Error(error.kind, "'" + path + "': " + error.message);
  }
}

GridBytes warp::copyGrids(const void *grids, size_t bytes) {
  return expandGrids(GridBytes(grids, bytes));
}

GridCodec warp::codecOf(const std::string &name) {
  static constexpr const char *names[] = {"none", "zip", "blosc"};
  for (int i = 0; i < 3; ++i)
    if (name == names[i])
      return GridCodec(i);
  throw Error(Error::Kind::Runtime,
              "Unsupported codec requested: '" + name +
                  "'; there are 'none', 'zip' and 'blosc'");
}

static AboutGrid aboutGrid(const Levels &levels, size_t packed,
                           GridCodec codec) {
  const GridHeader &header = levels.header;
  AboutGrid about{};
  about.size = header.size;
  about.fileSize = packed;
  about.voxels = levels.tree.voxels;
  about.type = header.type;
  about.gridClass = header.gridClass;
  std::copy_n(header.worldBox, 6, about.worldBox);
  std::copy_n(header.voxelSize, 3, about.voxelSize);
  std::memcpy(about.indexBox, levels.grid + levels.rootAt,
              sizeof about.indexBox);
  about.nameSize = uint32_t(strnlen(header.name, sizeof header.name)) + 1;
  std::copy_n(levels.tree.counts, 3, about.nodeCounts);
  about.nodeCounts[3] = 1;
  std::copy_n(levels.tree.tileCounts, 3, about.tileCounts);
  about.codec = uint16_t(codec);
  about.version = writtenVersion;
  return about;
}

void warp::writeGrids(const std::string &path, const void *grids, size_t bytes,
                      GridCodec codec) {
  auto *start = static_cast<uint8_t *>(const_cast<void *>(grids));
  uint32_t count = headerOf(start, bytes).count;
  std::vector<std::vector<uint8_t>> packed;
  std::string about;
  auto append = [&](const auto &what) {
    about.append(reinterpret_cast<const char *>(&what), sizeof what);
  };
  append(FileHeader{fileMagics[0], writtenVersion, uint16_t(count),
                    uint16_t(codec)});
  for (uint32_t i = 0; i < count; ++i) {
    Levels levels(start, bytes);
    packed.push_back(packGrid(start, size_t(levels.size), codec));
    append(aboutGrid(levels, packed.back().size(), codec));
    about += levels.info().name + '\0';
    start += levels.size;
    bytes -= levels.size;
  }
  errno = 0;
  std::ofstream file(path, std::ios::binary);
  file.write(about.data(), std::streamsize(about.size()));
  for (const std::vector<uint8_t> &grid : packed)
    file.write(reinterpret_cast<const char *>(grid.data()),
               std::streamsize(grid.size()));
  if (!file.flush())
    throw systemError(path);
}

//===- VdbFiles.cpp - OpenVDB files as NanoVDB grids and back -------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A C interface to OpenVDB and to NanoVDB's conversions of both directions.
// Grids pass as the bytes of a .nvdb file, which Volume reads and writes.
//
//===----------------------------------------------------------------------===//

#include <nanovdb/util/IO.h>
#include <nanovdb/util/NanoToOpenVDB.h>
#include <nanovdb/util/OpenToNanoVDB.h>
#include <openvdb/io/File.h>

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <sstream>
#include <stdexcept>
#include <string>

#define WARP_C_API extern "C" __attribute__((visibility("default")))

namespace {

void say(const std::string &text, char *error, std::size_t length) {
  std::strncpy(error, text.c_str(), length - 1);
  error[length - 1] = 0;
}

/// The grid of a name, or the first of a type that can be converted.
openvdb::GridBase::Ptr find(openvdb::io::File &file, const std::string &name) {
  if (!name.empty() && file.hasGrid(name))
    return file.readGrid(name);
  std::string all;
  for (auto it = file.beginName(); it != file.endName(); ++it) {
    if (name.empty())
      return file.readGrid(it.gridName());
    all += (all.empty() ? "'" : ", '") + it.gridName() + "'";
  }
  throw std::runtime_error(name.empty()
                               ? "the file has no grid"
                               : "no grid '" + name + "', the file has " + all);
}

/// Sets where a grid is: the conversion of version 10 drops the transposed
/// matrix that it makes, and takes the inverse of a rotation for it.
void place(const nanovdb::GridMetaData &file, openvdb::GridBase &grid) {
  const nanovdb::Map &map = file.map();
  openvdb::Mat4d matrix = openvdb::Mat4d::identity();
  matrix.setMat3(openvdb::Mat3d(map.mMatD).transpose());
  matrix.setTranslation(openvdb::Vec3d(map.mVecD));
  grid.setTransform(openvdb::math::Transform::createLinearTransform(matrix));
}

} // namespace

/// Reads a grid of a .vdb file; an empty name is the first. Gives the bytes
/// of a .nvdb file, to be freed by `warp_vdb_free`, or null and an error.
WARP_C_API void *warp_vdb_read(const char *path, const char *name,
                               std::size_t *size, char *error,
                               std::size_t length) {
  try {
    openvdb::initialize();
    openvdb::io::File file(path);
    // Parts that are read later would need the file to stay open.
    file.open(/*delayLoad=*/false);
    openvdb::GridBase::Ptr grid = find(file, name);
    nanovdb::GridHandle<> handle = nanovdb::openToNanoVDB(grid);
    // The writer skips the header first, which a string must have room for.
    nanovdb::io::Segment header(nanovdb::io::Codec::NONE);
    header.add(handle);
    std::ostringstream out(std::string(header.memUsage(), '\0'));
    nanovdb::io::writeGrid(out, handle);
    const std::string bytes = out.str();
    void *data = std::malloc(bytes.size());
    if (!data)
      throw std::bad_alloc();
    std::memcpy(data, bytes.data(), bytes.size());
    *size = bytes.size();
    return data;
  } catch (const std::exception &problem) {
    say(problem.what(), error, length);
    return nullptr;
  }
}

/// Writes the first grid of the bytes of a .nvdb file to a .vdb file. Gives 0,
/// or 1 and an error.
WARP_C_API int warp_vdb_write(const char *path, const char *name,
                              const void *data, std::size_t size, char *error,
                              std::size_t length) {
  try {
    openvdb::initialize();
    std::istringstream in(std::string(static_cast<const char *>(data), size));
    nanovdb::GridHandle<> handle = nanovdb::io::readGrid(in);
    openvdb::GridBase::Ptr grid = nanovdb::nanoToOpenVDB(handle);
    place(*handle.gridMetaData(), *grid);
    grid->setName(name);
    openvdb::io::File(path).write({grid});
    return 0;
  } catch (const std::exception &problem) {
    say(problem.what(), error, length);
    return 1;
  }
}

WARP_C_API void warp_vdb_free(void *data) { std::free(data); }

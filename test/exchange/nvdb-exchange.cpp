//===- nvdb-exchange.cpp - .nvdb files as NanoVDB writes and reads them ---===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//   nvdb-exchange write TYPE CODEC FILE
//       x + 10 y + 100 z in voxels (0, 0, 0) to (9, 8, 4), elsewhere the
//       background -7; the codec is none, zip or blosc
//   nvdb-exchange read FILE
//       values of voxels (-1, -1, -1) to (10, 9, 5), z fastest, one a line
//
//===----------------------------------------------------------------------===//

#include <nanovdb/util/GridBuilder.h>
#include <nanovdb/util/IO.h>

#include <cstdio>
#include <cstring>
#include <stdexcept>

using namespace nanovdb;

template <class Value, class Build = Value>
static void write(const char *path, io::Codec codec, Value unit) {
  // How far FpN may be off: its leaves have different widths then.
  GridBuilder<Value, Build> builder(unit * -7);
  auto accessor = builder.getAccessor();
  for (int x = 0; x < 10; ++x)
    for (int y = 0; y < 9; ++y)
      for (int z = 0; z < 5; ++z)
        accessor.setValue(Coord(x, y, z), unit * (x + 10 * y + 100 * z));
  auto grid = builder.getHandle(0.5, Vec3d(-1, 2, 3), "field", AbsDiff(20));
  io::writeGrid(path, grid, codec);
}

static void writeOf(const char *type, io::Codec codec, const char *path) {
  auto is = [&](const char *name) { return std::strcmp(type, name) == 0; };
  if (is("float"))
    return write<float>(path, codec, 1);
  if (is("double"))
    return write<double>(path, codec, 1);
  if (is("int32"))
    return write<int32_t>(path, codec, 1);
  if (is("int64"))
    return write<int64_t>(path, codec, 1);
  if (is("Vec3f"))
    return write<Vec3f>(path, codec, Vec3f(1));
  if (is("Fp4"))
    return write<float, Fp4>(path, codec, 1);
  if (is("Fp8"))
    return write<float, Fp8>(path, codec, 1);
  if (is("Fp16"))
    return write<float, Fp16>(path, codec, 1);
  if (is("FpN"))
    return write<float, FpN>(path, codec, 1);
  throw std::runtime_error("no such type");
}

static double numberOf(double value) { return value; }
static double numberOf(const Vec3f &value) { return value[2]; }

template <class Build> static bool read(const GridHandle<> &file) {
  const NanoGrid<Build> *grid = file.grid<Build>();
  if (!grid)
    return false;
  auto accessor = grid->getAccessor();
  for (int x = -1; x < 11; ++x)
    for (int y = -1; y < 10; ++y)
      for (int z = -1; z < 6; ++z)
        std::printf("%.17g\n", numberOf(accessor.getValue(Coord(x, y, z))));
  return true;
}

int main(int argc, char **argv) {
  try {
    if (argc == 5 && std::strcmp(argv[1], "write") == 0) {
      auto is = [&](const char *name) { return !std::strcmp(argv[3], name); };
      io::Codec codec = is("zip")     ? io::Codec::ZIP
                        : is("blosc") ? io::Codec::BLOSC
                                      : io::Codec::NONE;
      writeOf(argv[2], codec, argv[4]);
      return 0;
    }
    if (argc != 3 || std::strcmp(argv[1], "read") != 0)
      throw std::runtime_error(
          "expects 'write TYPE CODEC FILE' or 'read FILE'");
    GridHandle<> file = io::readGrid(argv[2]);
    if (read<float>(file) || read<double>(file) || read<int32_t>(file) ||
        read<int64_t>(file) || read<Vec3f>(file) || read<Fp4>(file) ||
        read<Fp8>(file) || read<Fp16>(file) || read<FpN>(file))
      return 0;
    throw std::runtime_error("a grid of another type");
  } catch (const std::exception &problem) {
    std::fprintf(stderr, "%s\n", problem.what());
    return 1;
  }
}

//===- Volumes.cpp - Sparse grids for Python ------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The package checks types and devices of arrays.
//
//===----------------------------------------------------------------------===//

#include "Geometry.h"

#include "warp/Volume.h"

#include <pybind11/stl.h>

#include <algorithm>

namespace py = pybind11;
using namespace warp;
using python::building;
using python::descriptorOf;
using python::optionalOf;

/// Points as rows: arrays of vectors, or of numbers and of shape (n, 3).
static GridPoints pointsOf(py::handle array, bool areVoxels, py::handle mask,
                           const std::string &name) {
  GridPoints points;
  points.points = descriptorOf(array);
  points.points.ndim = 1;
  points.areVoxels = areVoxels;
  points.mask = optionalOf(mask);
  points.device = python::asArray(array.ptr())->device;
  points.name = name;
  return points;
}

using Counts = std::array<int64_t, 4>;

static GridCounts countsOf(const Counts &counts) {
  return {counts[0], counts[1], counts[2], counts[3]};
}

static Counts arrayOf(const GridCounts &counts) {
  return {counts.leaves, counts.lowers, counts.uppers, counts.voxels};
}

/// Bytes of an object that gives them without a copy.
static py::buffer_info bytesOf(const py::buffer &buffer) {
  py::buffer_info info = buffer.request();
  py::ssize_t size = info.itemsize;
  for (auto axis = info.ndim; axis-- > 0; size *= info.shape[axis])
    if (info.shape[axis] > 1 && info.strides[axis] != size)
      throw py::value_error("expects bytes without gaps");
  return info;
}

static size_t sizeOf(const py::buffer_info &info) {
  return size_t(info.size * info.itemsize);
}

static void bindGrids(py::module_ &m) {
  py::class_<GridBytes>(m, "GridBytes", "Memory for grids.",
                        py::buffer_protocol())
      .def_buffer([](GridBytes &self) {
        return py::buffer_info(self.data(), py::ssize_t(self.size()));
      });
  m.def("read_grids", [](const py::buffer &file) {
    py::buffer_info bytes = bytesOf(file);
    return building("volume", int64_t(sizeOf(bytes)), "bytes",
                    [&] { return readGrids(bytes.ptr, sizeOf(bytes)); });
  });
  m.def("read_grids_of", &readGridsOf,
        py::call_guard<py::gil_scoped_release>());
  m.def("copy_grids", [](const py::buffer &grids) {
    py::buffer_info bytes = bytesOf(grids);
    return building("volume", int64_t(sizeOf(bytes)), "bytes",
                    [&] { return copyGrids(bytes.ptr, sizeOf(bytes)); });
  });
  m.def(
      "tiles_of_box",
      [](std::array<int64_t, 3> low, std::array<int64_t, 3> high) {
        int64_t from[3], to[3];
        std::copy_n(low.begin(), 3, from);
        std::copy_n(high.begin(), 3, to);
        std::vector<int32_t> tiles = tilesOfBox(from, to);
        return py::bytes(reinterpret_cast<const char *>(tiles.data()),
                         tiles.size() * sizeof(int32_t));
      },
      "Numbers of 32 bits, three for each tile.");
  m.def("missing_room", [](const GridBytes &grid, const Counts &room) {
    return missingRoom(grid, countsOf(room));
  });
}

static void bindRecipe(py::module_ &m) {
  py::class_<GridRecipe>(m, "GridRecipe", "How a grid follows from points.")
      .def(py::init(
          [](bool ofVoxels, uint32_t type, const std::string &background,
             std::array<double, 9> matrix, std::array<double, 3> shift) {
            GridRecipe recipe;
            recipe.ofVoxels = ofVoxels;
            recipe.type = VoxelType(type);
            recipe.background.assign(background.begin(), background.end());
            std::copy_n(matrix.begin(), 9, recipe.transform.matrix);
            std::copy_n(shift.begin(), 3, recipe.transform.shift);
            return recipe;
          }))
      .def_property_readonly("inverse",
                             [](const GridRecipe &self) {
                               double inverse[9];
                               invertMatrix(self.transform.matrix, inverse);
                               return std::vector<double>(inverse, inverse + 9);
                             })
      .def("bytes_for",
           [](const GridRecipe &self, const Counts &counts) {
             return self.bytesFor(countsOf(counts));
           })
      .def("make_empty", &GridRecipe::makeEmpty)
      .def("make",
           [](const GridRecipe &self, py::handle points, bool areVoxels,
              py::handle mask, const std::string &name) {
             GridPoints given = pointsOf(points, areVoxels, mask, name);
             return building("volume", given.points.shape[0], "points",
                             [&] { return self.make(given); });
           })
      .def("make_dense", [](const GridRecipe &self, const py::buffer &values,
                            std::array<int64_t, 3> shape) {
        py::buffer_info bytes = bytesOf(values);
        DenseValues dense{bytes.ptr, {shape[0], shape[1], shape[2]}};
        return building("volume", shape[0] * shape[1] * shape[2], "voxels",
                        [&] { return makeDense(self, dense); });
      });
  m.attr("voxel_types") = [] {
    py::dict types;
    for (const auto &[type, name] : voxelTypes())
      types[py::str(name)] = uint32_t(type);
    return types;
  }();
}

/// The parameters of kernels that write grids.
static void bindLayouts(py::module_ &m) {
  py::class_<GridLayout>(m, "GridLayout", "Offsets in grids.")
      .def_readonly("root_at", &GridLayout::rootAt)
      .def_readonly("root", &GridLayout::root)
      .def_readonly("tile", &GridLayout::tile)
      .def_readonly("upper", &GridLayout::upper)
      .def_readonly("upper_table", &GridLayout::upperTable)
      .def_readonly("lower", &GridLayout::lower)
      .def_readonly("lower_table", &GridLayout::lowerTable)
      .def_readonly("entry", &GridLayout::entry)
      .def_readonly("leaf", &GridLayout::leaf)
      .def_readonly("leaf_table", &GridLayout::leafTable)
      .def_readonly("value", &GridLayout::value);
  m.def("grid_layout",
        [](uint32_t type) { return gridLayout(VoxelType(type)); });
  m.attr("leaf_table_room") = leafTableRoom;
  GridWords words = gridWords();
  py::dict at;
  at["size"] = words.size;
  at["world_box"] = words.worldBox;
  at["tree"] = words.tree;
  at["slot_leaves"] = words.slotLeaves;
  at["slot_tiles"] = words.slotTiles;
  at["slot_voxels"] = words.slotVoxels;
  at["slot_leaves_end"] = words.slotLeavesEnd;
  at["slot_numbers"] = words.slotNumbers;
  at["slot_lowest"] = words.slotLowest;
  at["slot_extent"] = words.slotExtent;
  m.attr("grid_words") = at;
}

static void bindInfo(py::module_ &m) {
  py::class_<GridInfo>(m, "GridInfo", "Metadata of a grid.")
      .def_readonly("name", &GridInfo::name)
      .def_property_readonly(
          "type", [](const GridInfo &self) { return uint32_t(self.type); })
      .def_property_readonly(
          "type_name", [](const GridInfo &self) { return nameOf(self.type); })
      .def_readonly("is_index", &GridInfo::isIndex)
      .def_readonly("index", &GridInfo::index)
      .def_readonly("count", &GridInfo::count)
      .def_readonly("size", &GridInfo::size)
      .def_property_readonly("matrix",
                             [](const GridInfo &self) {
                               const double *matrix = self.transform.matrix;
                               return std::vector<double>(matrix, matrix + 9);
                             })
      .def_property_readonly("shift",
                             [](const GridInfo &self) {
                               const double *shift = self.transform.shift;
                               return std::vector<double>(shift, shift + 3);
                             })
      .def_property_readonly("voxel_size",
                             [](const GridInfo &self) {
                               return std::vector<double>(self.voxelSize,
                                                          self.voxelSize + 3);
                             })
      .def_property_readonly(
          "counts", [](const GridInfo &self) { return arrayOf(self.counts); })
      .def_readonly("features", &GridInfo::features)
      .def_readonly("leaves_at", &GridInfo::leavesAt)
      .def_readonly("leaf_size", &GridInfo::leafSize)
      .def_readonly("leaf_table", &GridInfo::leafTable)
      .def_readonly("value_size", &GridInfo::valueSize);
  py::class_<GridFeature>(m, "GridFeature", "An array beside a grid.")
      .def_readonly("name", &GridFeature::name)
      .def_readonly("type", &GridFeature::type)
      .def_readonly("at", &GridFeature::at)
      .def_readonly("value_size", &GridFeature::valueSize)
      .def_readonly("count", &GridFeature::count);
}

using Lister = int64_t (Volume::*)(int32_t *, int64_t) const;

/// Writes rows of three numbers into memory of the host.
template <Lister list>
static int64_t listInto(const Volume &self, const py::buffer &rows) {
  py::buffer_info bytes = rows.request(true);
  auto *first = static_cast<int32_t *>(bytes.ptr);
  int64_t room = int64_t(sizeOf(bytes) / (3 * sizeof(int32_t)));
  py::gil_scoped_release unlocked;
  return (self.*list)(first, room);
}

static void bindVolume(py::module_ &m) {
  py::class_<Volume>(m, "Volume", "A grid that kernels read.")
      .def(py::init([](const GridBytes &grids, int device) {
        return building("volume", int64_t(grids.size()), "bytes", [&] {
          return std::make_unique<Volume>(grids, device);
        });
      }))
      .def(py::init([](uint64_t address, size_t bytes, int device) {
        auto *grid = reinterpret_cast<void *>(address);
        return building("volume", int64_t(bytes), "bytes", [&] {
          return std::make_unique<Volume>(grid, bytes, device);
        });
      }))
      .def(py::init([](uint64_t address, size_t bytes, int device,
                       const GridBytes &contents) {
        auto *grid = reinterpret_cast<void *>(address);
        return std::make_unique<Volume>(grid, bytes, device, contents);
      }))
      .def_property_readonly("id", &Volume::id)
      .def_property_readonly("data",
                             [](const Volume &self) {
                               return reinterpret_cast<uint64_t>(self.data());
                             })
      .def_property_readonly("size", &Volume::size)
      .def_property_readonly(
          "memory",
          [](const Volume &self) {
            return py::capsule(
                new std::shared_ptr<void>(self.memory()), [](void *owner) {
                  delete static_cast<std::shared_ptr<void> *>(owner);
                });
          },
          "Keeps the memory that the grid is in.")
      .def_property_readonly("info", &Volume::info,
                             py::return_value_policy::copy)
      .def("assign", &Volume::assign, py::call_guard<py::gil_scoped_release>())
      .def("rebuild",
           [](Volume &self, const GridRecipe &recipe, py::handle points,
              bool areVoxels, py::handle mask, const std::string &name,
              const Counts &room) {
             GridPoints given = pointsOf(points, areVoxels, mask, name);
             return building("volume", given.points.shape[0], "points", [&] {
               return self.rebuild(recipe, given, countsOf(room));
             });
           })
      .def("refresh", &Volume::refresh,
           py::call_guard<py::gil_scoped_release>())
      .def("tiles_into", &listInto<&Volume::tiles>)
      .def("voxels_into", &listInto<&Volume::voxels>)
      .def("feature", &Volume::feature)
      .def_property_readonly("next", &Volume::next)
      .def("save", [](const Volume &self, const std::string &path,
                      const std::string &codec) {
        py::gil_scoped_release unlocked;
        self.save(path, codecOf(codec));
      });
}

void python::bindVolumes(py::module_ &m) {
  bindGrids(m);
  bindRecipe(m);
  bindLayouts(m);
  bindInfo(m);
  bindVolume(m);
}

//===- Geometry.cpp - Meshes, hierarchies and grids for Python ------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The package checks types and devices of arrays and keeps them alive.
//
//===----------------------------------------------------------------------===//

#include "Geometry.h"

#include "warp/Graph.h"
#include "warp/HashGrid.h"
#include "warp/Memory.h"
#include "warp/Mesh.h"
#include "warp/TreeBuild.h"

#include <pybind11/stl.h>

namespace py = pybind11;
using namespace warp;
using python::building;
using python::descriptorOf;
using python::optionalOf;

static MeshArrays arraysOf(py::handle points, py::handle velocities,
                           py::handle indices, py::handle groups = py::none()) {
  MeshArrays arrays;
  arrays.groups = optionalOf(groups);
  arrays.points = descriptorOf(points);
  arrays.velocities = optionalOf(velocities);
  arrays.indices = descriptorOf(indices);
  return arrays;
}

/// By the numbers that the package has for them.
static BvhConstructor constructorOf(int number) {
  return BvhConstructor(number);
}

/// Lets graphs that this thread records on the CPU keep what an update needs.
template <class... Arrays> static void holdAll(Arrays... arrays) {
  (python::hold(arrays.ptr()), ...);
}

static void bindBvh(py::module_ &m) {
  py::class_<BvhReport>(m, "BvhReport", "Sizes of a hierarchy.")
      .def_readonly("skipped", &BvhReport::skipped)
      .def_readonly("nodes", &BvhReport::nodes)
      .def_readonly("blocks", &BvhReport::blocks)
      .def_readonly("bytes", &BvhReport::bytes)
      .def_readonly("depth", &BvhReport::depth);
  py::class_<HierarchyView>(m, "HierarchyView", "Addresses of a hierarchy.")
      .def_readonly("nodes", &HierarchyView::nodes)
      .def_readonly("blocks", &HierarchyView::blocks)
      .def_readonly("block_count", &HierarchyView::blockCount)
      .def_readonly("scale", &HierarchyView::scale)
      .def_readonly("order", &HierarchyView::order)
      .def_readonly("levels", &HierarchyView::levels);
  py::class_<Bvh>(m, "Bvh", "A hierarchy over boxes.")
      .def(py::init([](py::handle lowers, py::handle uppers, py::handle groups,
                       int device, int constructor) {
        const ArrayDescriptor &low = descriptorOf(lowers);
        const ArrayDescriptor &high = descriptorOf(uppers);
        ArrayDescriptor numbers = optionalOf(groups);
        return building("hierarchy", low.shape[0], "boxes", [&] {
          return std::make_unique<Bvh>(low, high, device,
                                       constructorOf(constructor), numbers);
        });
      }))
      .def_property_readonly("id", &Bvh::id)
      .def("adopt",
           [](Bvh &self, uint64_t nodes, size_t nodeBytes, uint64_t blocks,
              size_t blockBytes, uint64_t groups) {
             self.adopt({nodes, blocks, nodeBytes, blockBytes, groups});
           })
      .def_property_readonly("report", &Bvh::report)
      .def_property_readonly("view", &Bvh::view)
      .def("refit",
           [](Bvh &self, py::handle lowers, py::handle uppers) {
             holdAll(lowers, uppers);
             const ArrayDescriptor &low = descriptorOf(lowers);
             const ArrayDescriptor &high = descriptorOf(uppers);
             building("hierarchy", low.shape[0], "boxes",
                      [&] { self.refit(low, high); });
           })
      .def("rebuild", [](Bvh &self, py::handle lowers, py::handle uppers,
                         py::handle groups, int constructor) {
        holdAll(lowers, uppers, groups);
        const ArrayDescriptor &low = descriptorOf(lowers);
        const ArrayDescriptor &high = descriptorOf(uppers);
        ArrayDescriptor numbers = optionalOf(groups);
        building("hierarchy", low.shape[0], "boxes", [&] {
          self.rebuild(low, high, constructorOf(constructor), numbers);
        });
      });
}

static void bindMesh(py::module_ &m) {
  py::class_<Mesh>(m, "Mesh", "A triangle mesh that kernels search.")
      .def(py::init([](py::handle points, py::handle velocities,
                       py::handle indices, py::handle groups, int device,
                       int constructor, bool hasWinding) {
        MeshArrays arrays = arraysOf(points, velocities, indices, groups);
        return building("mesh", arrays.indices.shape[0], "indices", [&] {
          return std::make_unique<Mesh>(arrays, device,
                                        constructorOf(constructor), hasWinding);
        });
      }))
      .def_property_readonly("id", &Mesh::id)
      .def("adopt",
           [](Mesh &self, py::handle points, py::handle velocities,
              py::handle indices, uint64_t nodes, size_t nodeBytes,
              uint64_t blocks, size_t blockBytes, uint64_t groups) {
             self.adopt(arraysOf(points, velocities, indices),
                        {nodes, blocks, nodeBytes, blockBytes, groups});
           })
      .def("support_winding",
           [](Mesh &self, py::handle points, py::handle velocities,
              py::handle indices) {
             MeshArrays arrays = arraysOf(points, velocities, indices);
             building("mesh", arrays.indices.shape[0], "indices",
                      [&] { self.supportWinding(arrays); });
           })
      .def_property_readonly("report", &Mesh::report)
      .def_property_readonly("view", &Mesh::view)
      .def("refit",
           [](Mesh &self, py::handle points, py::handle velocities,
              py::handle indices) {
             holdAll(points, velocities, indices);
             MeshArrays arrays = arraysOf(points, velocities, indices);
             building("mesh", arrays.indices.shape[0], "indices",
                      [&] { self.refit(arrays); });
           })
      .def("rebuild", [](Mesh &self, py::handle points, py::handle velocities,
                         py::handle indices, py::handle groups,
                         int constructor) {
        holdAll(points, velocities, indices, groups);
        MeshArrays arrays = arraysOf(points, velocities, indices, groups);
        building("mesh", arrays.indices.shape[0], "indices",
                 [&] { self.rebuild(arrays, constructorOf(constructor)); });
      });
}

static void bindHashGrid(py::module_ &m) {
  py::class_<HashGrid>(m, "HashGrid", "Points by the cells of a grid.")
      .def(py::init([](int x, int y, int z) {
        const int32_t cells[3] = {x, y, z};
        return building("hash grid", int64_t(x) * y * z, "cells",
                        [&] { return std::make_unique<HashGrid>(cells); });
      }))
      .def_property_readonly("id", &HashGrid::id)
      .def_property_readonly("skipped", &HashGrid::skipped)
      .def("reserve", &HashGrid::reserve)
      .def("build", [](HashGrid &self, py::handle points, int scalarSize,
                       double width, py::handle groups) {
        holdAll(points, groups);
        const ArrayDescriptor &array = descriptorOf(points);
        ArrayDescriptor numbers = optionalOf(groups);
        building("hash grid", array.shape[0], "points",
                 [&] { self.build(array, scalarSize, width, numbers); });
      });
}

static void bindHandle(py::module_ &m) {
  py::class_<GeometryHandle>(m, "GeometryHandle",
                             "A number by which kernels know an object.")
      .def(py::init([](int kind, int device) {
        return std::make_unique<GeometryHandle>(GeometryKind(kind), device);
      }))
      .def_property_readonly("id", &GeometryHandle::id)
      .def("write", [](GeometryHandle &self, const py::bytes &contents) {
        std::string_view view = contents;
        if (view.size() > 248)
          throw py::value_error("a slot has 248 bytes");
        self.write(view.data(), view.size());
      });
}

/// The memory of an array, which a capture keeps.
template <class T> static T *dataOf(py::handle array) {
  const ArrayDescriptor &descriptor = descriptorOf(array);
  python::hold(python::asArray(array.ptr())->device, array.ptr());
  return static_cast<T *>(descriptor.data);
}

/// The source of a hierarchy, in memory for its nodes, its blocks and the
/// results, for the handle `id`.
static TreeBuild treeOf(py::handle first, py::handle second, bool ofTriangles,
                        bool alongCurve, py::handle memory, uint64_t id) {
  // The words of slots (lib/Geometry/Slots.h).
  constexpr int scaleAt = 24;
  constexpr uint64_t addressMask = (uint64_t(1) << 49) - 1;
  int64_t elements = descriptorOf(second).shape[0];
  TreeBuild build{};
  build.first = dataOf<void>(first);
  build.points = descriptorOf(first).shape[0];
  build.second = dataOf<void>(second);
  build.count = int32_t(ofTriangles ? elements / 3 : elements);
  build.ofTriangles = ofTriangles;
  build.alongCurve = alongCurve;
  TreeShape shape(build.count);
  char *at = dataOf<char>(memory);
  build.nodes = at;
  build.blocks = at += shape.nodes() * TreeShape::nodeBytes;
  build.found = reinterpret_cast<int32_t *>(
      at + shape.blocks * TreeShape::blockBytes(ofTriangles));
  build.scale = reinterpret_cast<float *>((id & addressMask) + scaleAt);
  return build;
}

static void bindTrees(py::module_ &m) {
  using Handle = py::handle;
  m.def(
      "tree_shape",
      [](int64_t count) {
        TreeShape shape(count);
        return std::pair(shape.levels, shape.blocks);
      },
      "Nodes of each level, and blocks.");
  m.def(
      "build_tree",
      [](Handle first, Handle second, bool ofTriangles, bool alongCurve,
         Handle memory, uint64_t id, bool reads) {
        TreeBuild build =
            treeOf(first, second, ofTriangles, alongCurve, memory, id);
        int device = python::asArray(memory.ptr())->device;
        std::optional<TreeFindings> findings;
        std::optional<std::pair<int, int>> found;
        py::gil_scoped_release unlocked;
        if (reads && !isCapturing(device))
          build.findings = &findings.emplace(device);
        buildTree(device, build);
        if (findings)
          found = findings->wait();
        return found;
      },
      "Queues the build of a hierarchy on a GPU. What `read_tree` gives, if it "
      "is wanted and no graph is captured; that is there before the end.");
  m.def(
      "refit_tree",
      [](Handle first, Handle second, bool ofTriangles, Handle memory,
         uint64_t id) {
        TreeBuild build = treeOf(first, second, ofTriangles, false, memory, id);
        int device = python::asArray(memory.ptr())->device;
        py::gil_scoped_release unlocked;
        refitTree(device, build);
      },
      "Queues a refit of what `build_tree` built.");
  m.def(
      "read_tree",
      [](Handle memory) {
        int32_t found[2];
        const ArrayDescriptor &words = descriptorOf(memory);
        int device = python::asArray(memory.ptr())->device;
        auto *end = dataOf<int32_t>(memory) + words.shape[0];
        py::gil_scoped_release unlocked;
        download(found, end - 2, device, sizeof found);
        return std::pair(found[0], found[1]);
      },
      "The first face with a wrong index, or how many there are, and how many "
      "primitives are never found; waits for the build.");
}

void python::bindGeometry(py::module_ &m) {
  bindTrees(m);
  bindBvh(m);
  bindMesh(m);
  bindHashGrid(m);
  bindHandle(m);
  bindVolumes(m);
  m.def(
      "describe_handle",
      [](uint64_t id, int kind, int device) {
        return describeHandle(id, GeometryKind(kind), device);
      },
      "The fault of a handle; empty if there is none.");
  m.def("write_handle_word", &writeHandleWord,
        "Writes a word of what a live handle leads to.");
}

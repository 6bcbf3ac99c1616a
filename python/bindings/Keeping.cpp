//===- Keeping.cpp - Copy-on-write of recorded memory ---------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// If a tape has to keep something for each launch, the copies are made
// here, and adjoints read them in place of the memory.
//
//===----------------------------------------------------------------------===//

#include "Keeping.h"

#include "warp/Memory.h"

#include <algorithm>

namespace py = pybind11;
using namespace warp;
using namespace warp::python;

//===----------------------------------------------------------------------===//
// Copies
//===----------------------------------------------------------------------===//

/// The elements of a block, and of a packed array with as many.
static int64_t describe(const MemoryBlock &block, ArrayDescriptor &from,
                        ArrayDescriptor &to) {
  from.ndim = to.ndim = std::max(block.rank, 1);
  from.shape[0] = to.shape[0] = 1;
  from.strides[0] = int32_t(block.item);
  for (int i = 0; i < block.rank; ++i) {
    from.shape[i] = to.shape[i] = int32_t(block.dims[i].count);
    from.strides[i] = int32_t(block.dims[i].stride * block.dims[i].step);
  }
  int64_t bytes = block.item;
  for (int i = to.ndim; i-- > 0; bytes *= to.shape[i])
    to.strides[i] = int32_t(bytes);
  from.data = reinterpret_cast<void *>(block.start);
  return bytes;
}

/// A packed array of a class, with a block's elements, which are like those of
/// another array.
static py::object copyBlock(const MemoryBlock &block, const ArrayObject *like,
                            PyTypeObject *type) {
  ArrayDescriptor from, to;
  int64_t bytes = describe(block, from, to);
  auto buffer = std::make_unique<Buffer>(like->device, size_t(bytes));
  to.data = buffer->data();
  auto copy = [&] {
    copyArray({&to, like->device}, {&from, like->device}, size_t(block.item));
  };
  if (bytes < 1 << 16) {
    copy();
  } else {
    py::gil_scoped_release unlocked;
    copy();
  }
  auto made = py::reinterpret_steal<py::object>(
      arrayType->tp_new(type, nullptr, nullptr));
  if (!made)
    throw py::error_already_set();
  ArrayObject *array = asArray(made.ptr());
  array->descriptor = to;
  array->descriptor.flags = arrayFacts(to, size_t(block.item));
  array->itemSize = block.item;
  array->typeId = array->packId = like->typeId;
  array->device = like->device;
  array->pinned = false;
  Py_XSETREF(array->dtype, Py_NewRef(like->dtype));
  Py_XSETREF(array->owner, py::cast(std::move(buffer)).release().ptr());
  return made;
}

/// None where Python has to do it: graphs being recorded, strides that no
/// descriptor holds.
static py::object keepBlocks(const Region &region, py::handle array,
                             py::handle type) {
  if (!isArray(array.ptr()))
    throw py::type_error("expects an array");
  if (capturesInProgress || region.bytes() > INT32_MAX)
    return py::none();
  py::list copies;
  for (const MemoryBlock &block : region.blocks)
    copies.append(copyBlock(block, asArray(array.ptr()),
                            reinterpret_cast<PyTypeObject *>(type.ptr())));
  return copies;
}

//===----------------------------------------------------------------------===//
// Kept memory
//===----------------------------------------------------------------------===//

PyObject *python::keptContents(VersionObject *version, PyObject *value) {
  const ArrayObject *array = asArray(value);
  if (!version->complete || version->lent || !array->isContiguous() ||
      !version->pieces || PyList_GET_SIZE(version->pieces) != 1)
    return nullptr;
  static PyObject *const regionName = PyUnicode_InternFromString("region");
  static PyObject *const copiesName = PyUnicode_InternFromString("copies");
  PyObject *piece = PyList_GET_ITEM(version->pieces, 0);
  auto region =
      py::reinterpret_steal<py::object>(PyObject_GetAttr(piece, regionName));
  auto copies =
      py::reinterpret_steal<py::object>(PyObject_GetAttr(piece, copiesName));
  if (!region || !copies)
    throw py::error_already_set();
  const auto &kept = region.cast<const Region &>();
  if (kept.blocks.size() != 1 ||
      !(kept.blocks[0] == blockOf(array->descriptor, array->itemSize)) ||
      !PyList_Check(copies.ptr()) || PyList_GET_SIZE(copies.ptr()) != 1)
    return nullptr;
  // The piece holds it.
  PyObject *copy = PyList_GET_ITEM(copies.ptr(), 0);
  return isArray(copy) && asArray(copy)->isContiguous() ? copy : nullptr;
}

void python::bindKeeping(py::module_ &m) {
  m.def("keep_blocks", &keepBlocks, py::arg("region"), py::arg("array"),
        py::arg("type"),
        "Packed copies of the blocks of a region, arrays of a class with "
        "elements like those of `array`; None where that is not done here.");
}

//===- Versions.h - Former contents of memory regions -----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The part of `Version` and `Memory` (python/warp/_src/arrays/versions.py) that
// each recorded launch needs: to find the version of a region, and to end those
// that a write overlaps and nobody needs. Python keeps the regions to copy.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_PYTHON_BINDINGS_VERSIONS_H
#define WARP_PYTHON_BINDINGS_VERSIONS_H

#include "Native.h"

#include "warp/RegionMap.h"

#include <memory>
#include <unordered_map>
#include <vector>

namespace warp::python {

struct VersionObject;

/// Regions that have a version, and which one is current. Versions are not
/// owned: one that dies takes its region out.
struct VersionTable {
  RegionMap regions;
  std::unordered_map<int64_t, VersionObject *> current;

  void forget(int64_t number) {
    current.erase(number);
    regions.remove(number);
  }
};

/// Who wants a version kept: a weak reference, and whose budget copies are of.
struct Reader {
  PyObject *reference, *budget;
};

struct RecordObject;

/// A weak reference to a record on a tape, which is cheaper than Python's.
struct RecordToken {
  /// Null when it is gone.
  RecordObject *record;
  unsigned owners = 1;

  RecordToken *share() {
    ++owners;
    return this;
  }
  void drop() {
    if (--owners == 0)
      delete this;
  }
};

/// The instance layout of `warp._native.Version`; null stands for None.
struct VersionObject {
  PyObject base;
  PyObject *weak;
  PyObject *array, *copy;
  PyObject *region, *pieces, *ended, *refused, *lent;
  PyObject *successor, *predecessor, *listeners;
  std::vector<Reader> *readers;
  /// Native records that read it.
  std::vector<RecordToken *> *records;
  std::shared_ptr<VersionTable> *table;
  int64_t number;
  /// Bytes that are in no piece.
  int64_t rest;
  bool complete;
};

inline VersionObject *asVersion(PyObject *object) {
  return reinterpret_cast<VersionObject *>(object);
}

/// True if nothing was written to the memory since the version began, as far
/// as can be told without looking there.
inline bool isIntact(const VersionObject *version) {
  return !version->ended && !version->lent &&
         (!version->pieces || PyList_GET_SIZE(version->pieces) == 0);
}

/// The place of a call of a launch: a kernel, a code object and an instruction
/// of it, or a negative line. Python makes an event of it.
struct PlaceObject {
  PyObject base;
  PyObject *kernel, *code;
  int instruction;
};
/// A new reference.
PyObject *makePlace(PyObject *kernel, PyObject *code, int instruction);

void addReader(VersionObject *version, RecordToken *token);

/// A write that ends versions: makes what says who it was. `mark` may be a
/// place instead of an event.
class Writer {
public:
  virtual ~Writer() = default;
  virtual pybind11::object mark() = 0;
  virtual pybind11::object event() = 0;
};

/// The native half of `Memory`.
class VersionMap {
public:
  explicit VersionMap(pybind11::object copy) : copy(std::move(copy)) {}

  /// The current version of a region of an array. `self` is the `Memory`.
  pybind11::object observe(PyObject *self, PyObject *array,
                           const Region &region);
  /// Ends the versions of all regions that share bytes with one of these.
  void end(const std::vector<const Region *> &written, Writer &by);

  std::shared_ptr<VersionTable> table = std::make_shared<VersionTable>();
  pybind11::object copy;
};

void bindVersions(pybind11::module_ &m);
void bindRecords(pybind11::module_ &m);

} // namespace warp::python

#endif // WARP_PYTHON_BINDINGS_VERSIONS_H

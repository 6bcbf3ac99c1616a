//===- Records.h - Launches on a tape ---------------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A tape of a million launches is recorded and run backwards here; what is
// rare (structs in structs, parts of what was kept, streams, graphs, loops that
// need memory) is left to Python, before anything has been done.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_PYTHON_BINDINGS_RECORDS_H
#define WARP_PYTHON_BINDINGS_RECORDS_H

#include "LaunchCall.h"
#include "RegionFinder.h"
#include "Versions.h"

#include <optional>

namespace warp::python {

/// A set of the arrays among the arguments, by number.
using ArraySet = uint64_t;
inline constexpr size_t mostArrays = 64;

/// The facts about the adjoint for a set of arrays with gradients.
struct Activity {
  ArraySet active = 0, apart = 0;
  /// When `needed` was found out; 0 is never.
  unsigned generation = 0;
  /// There is an adjoint, which wants nothing kept of the launch itself.
  bool hasAdjoint = false, isPlain = false;
  /// Arrays that it reads, and those of which it reads what they held before
  /// the launch; that may be all it wants kept.
  ArraySet needed = 0, preserved = 0;
  bool isPreserving = false;
  /// The backward pass that asked last, and the native adjoint if a launch of
  /// it is all there is to do.
  uint64_t pass = 0;
  pybind11::object adjoint;
  /// Its arguments behind those of the launch: arrays as they were before, by
  /// number.
  std::vector<unsigned> former;
};

/// Regions of a launch, and what follows from them.
struct KnownRegions {
  std::string params;
  LaunchDim dim;
  LaunchRegions regions;
  bool hasAliases = false;
  ArraySet apart = 0;
};

/// An array in a struct among the arguments: which one, of which class, and the
/// field.
struct StructField {
  size_t position;
  pybind11::object type, name;
};

/// The facts about a native kernel that recording needs.
class LaunchRecorder : public RegionFinder {
public:
  /// `fields` has (position, class, name) of each array if some are in structs,
  /// with None for class and name of those that are not; else it is None.
  LaunchRecorder(pybind11::object kernel, pybind11::object fields);

  Activity &activity(ArraySet active, ArraySet apart);
  std::shared_ptr<const KnownRegions> regions(const LaunchDim &dim,
                                              const char *params);

  /// The places of arrays among the items of a record: where they are among the
  /// arguments, or behind all of these if some are in structs.
  std::vector<size_t> arrays;
  /// Positions of composites and structs among the parameters.
  std::vector<size_t> composites;
  std::vector<StructField> fields;
  ArraySet written = 0;
  bool looksBack = false;
  /// False if Python has to do it.
  bool isEligible = false;

private:
  std::vector<std::unique_ptr<Activity>> activities;
  std::shared_ptr<const KnownRegions> last;
};

/// The instance layout of `warp._native.Record`; null stands for None.
struct RecordObject {
  PyObject base;
  PyObject *weak;
  PyObject *kernel, *native, *dim, *stream, *place;
  /// For records that were made here.
  PyObject *recorder;
  PyObject *budget;
  /// The objects that Python keeps.
  PyObject *versions, *call, *event, *before, *behind, *saved, *aliases, *apart,
      *originals, *made;
  /// For records that were made here: the arguments, after them all arrays if
  /// some are in structs, and the version of each array, null without elements
  /// or gradients.
  PyObject **items;
  RecordToken *token;
  Activity *activity;
  int itemCount, valueCount, arrayCount;
  int device, blockDim;
  bool pending, hasGradients;
};

inline RecordObject *asRecord(PyObject *object) {
  return reinterpret_cast<RecordObject *>(object);
}
inline PyObject **versionsOf(const RecordObject *record) {
  return record->items + record->itemCount - record->arrayCount;
}
extern PyTypeObject *recordBase;
inline bool isRecord(PyObject *object) {
  return PyObject_TypeCheck(object, recordBase);
}

/// True if a record's adjoint reads what a version is of; nothing if that is
/// for Python to say.
std::optional<bool> recordNeeds(RecordObject *record, VersionObject *version);

/// The arrays among the arguments that have a gradient, or are to get one.
ArraySet activeArrays(const LaunchRecorder &recorder, PyObject *const *values);

/// Finds out what the adjoint reads, once.
void findNeeds(Activity &activity, PyObject *kernel,
               const LaunchRecorder &recorder);

/// A record made by `launch_recorded`; a new reference.
PyObject *makeRecord();

/// Python's functions `needs(kernel, native, active, apart)` and
/// `plain_adjoint(kernel, native, active, apart, element_types)`.
struct AdjointQueries {
  PyObject *needs = nullptr, *plainAdjoint = nullptr;
};
AdjointQueries &adjointQueries();
/// Flags by number, as Python wants them.
pybind11::tuple flagsOf(ArraySet set, size_t count);

void bindLaunchRecorder(pybind11::module_ &m);
void bindReverse(pybind11::module_ &m);

} // namespace warp::python

#endif // WARP_PYTHON_BINDINGS_RECORDS_H

//===- Records.cpp - Launches on a tape -----------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Records.h"

#include <structmember.h>

namespace py = pybind11;
using namespace warp;
using namespace warp::python;

PyTypeObject *python::recordBase = nullptr;
/// The class in Python, once it is known.
static PyTypeObject *recordType = nullptr;
/// Goes up when the settings change that say what an adjoint reads.
static unsigned generation = 1;

AdjointQueries &python::adjointQueries() {
  static AdjointQueries queries;
  return queries;
}

//===----------------------------------------------------------------------===//
// The object
//===----------------------------------------------------------------------===//

static PyObject *newRecord(PyTypeObject *type, PyObject *, PyObject *) {
  PyObject *object = type->tp_alloc(type, 0);
  if (object) {
    asRecord(object)->device = defaultDevice;
    asRecord(object)->pending = true;
  }
  return object;
}

PyObject *python::makeRecord() {
  return newRecord(recordType, nullptr, nullptr);
}

/// Python's classes take what arguments they like.
static int initRecord(PyObject *, PyObject *, PyObject *) { return 0; }

static PyObject **membersOf(RecordObject *record, size_t &count) {
  count = (reinterpret_cast<char *>(&record->made) -
           reinterpret_cast<char *>(&record->kernel)) /
              sizeof(PyObject *) +
          1;
  return &record->kernel;
}

static int traverseRecord(PyObject *self, visitproc visit, void *arg) {
  Py_VISIT(Py_TYPE(self));
  size_t count;
  PyObject **members = membersOf(asRecord(self), count);
  for (size_t i = 0; i < count; ++i)
    Py_VISIT(members[i]);
  // Versions are no part of cycles.
  for (int i = 0; i < asRecord(self)->itemCount - asRecord(self)->arrayCount;
       ++i)
    Py_VISIT(asRecord(self)->items[i]);
  return 0;
}

static int clearRecord(PyObject *self) {
  asRecord(self)->activity = nullptr;
  size_t count;
  PyObject **members = membersOf(asRecord(self), count);
  for (size_t i = 0; i < count; ++i)
    Py_CLEAR(members[i]);
  for (int i = 0; i < asRecord(self)->itemCount; ++i)
    Py_CLEAR(asRecord(self)->items[i]);
  return 0;
}

static void deallocRecord(PyObject *self) {
  PyTypeObject *type = Py_TYPE(self);
  PyObject_GC_UnTrack(self);
  if (RecordToken *token = asRecord(self)->token) {
    token->record = nullptr;
    token->drop();
  }
  if (asRecord(self)->weak)
    PyObject_ClearWeakRefs(self);
  clearRecord(self);
  delete[] asRecord(self)->items;
  type->tp_free(self);
  Py_DECREF(type);
}

//===----------------------------------------------------------------------===//
// Reads of adjoints
//===----------------------------------------------------------------------===//

py::tuple python::flagsOf(ArraySet set, size_t count) {
  py::tuple flags(count);
  for (size_t i = 0; i < count; ++i)
    flags[i] = py::bool_(set >> i & 1);
  return flags;
}

static ArraySet setOf(const py::object &numbers) {
  ArraySet set = 0;
  for (py::handle number : numbers)
    set |= ArraySet(1) << number.cast<unsigned>();
  return set;
}

void python::findNeeds(Activity &activity, PyObject *kernel,
                       const LaunchRecorder &recorder) {
  if (activity.generation == generation)
    return;
  size_t count = recorder.arrays.size();
  py::handle native(reinterpret_cast<PyObject *>(recorder.kernel()));
  py::object apart = py::tuple();
  if (activity.apart)
    apart = flagsOf(activity.apart, count);
  py::object found = py::handle(adjointQueries().needs)(
      py::handle(kernel), native, flagsOf(activity.active, count), apart);
  activity.hasAdjoint = !found.is_none();
  activity.isPlain = true;
  activity.isPreserving = false;
  activity.needed = activity.preserved = 0;
  if (activity.hasAdjoint) {
    auto [needed, preserved, isPlain] =
        found.cast<std::tuple<py::object, py::object, bool>>();
    activity.isPlain = isPlain;
    activity.needed = setOf(needed);
    activity.isPreserving = !preserved.is_none();
    if (activity.isPreserving)
      activity.preserved = setOf(preserved);
  }
  activity.generation = generation;
}

std::optional<bool> python::recordNeeds(RecordObject *record,
                                        VersionObject *version) {
  if (!record->activity)
    return std::nullopt;
  PyObject *key, *former;
  for (Py_ssize_t at = 0; record->before && PyDict_Check(record->before) &&
                          PyDict_Next(record->before, &at, &key, &former);)
    if (former == reinterpret_cast<PyObject *>(version))
      return true;
  const auto &recorder = py::handle(record->recorder).cast<LaunchRecorder &>();
  findNeeds(*record->activity, record->kernel, recorder);
  auto *wanted = reinterpret_cast<PyObject *>(version);
  PyObject **versions = versionsOf(record);
  for (size_t i = 0; i < recorder.arrays.size(); ++i)
    if ((record->activity->needed >> i & 1) && versions[i] == wanted)
      return true;
  return false;
}

ArraySet python::activeArrays(const LaunchRecorder &recorder,
                              PyObject *const *values) {
  static PyObject *const name = PyUnicode_InternFromString("_requires_grad");
  ArraySet active = 0;
  for (size_t i = 0; i < recorder.arrays.size(); ++i) {
    PyObject *value = values[recorder.arrays[i]];
    bool has = asArray(value)->descriptor.grad;
    if (!has) {
      auto wanted =
          py::reinterpret_steal<py::object>(PyObject_GetAttr(value, name));
      if (!wanted)
        throw py::error_already_set();
      has = wanted.ptr() == Py_True;
    }
    active |= ArraySet(has) << i;
  }
  return active;
}

//===----------------------------------------------------------------------===//
// Attributes
//===----------------------------------------------------------------------===//

/// Flags of the arrays that are read and written in different places.
static PyObject *notedApart(PyObject *self, PyObject *) {
  return guarded([&] {
    RecordObject *record = asRecord(self);
    Activity *activity = record->activity;
    if (!activity || !activity->apart)
      return py::tuple().release().ptr();
    return flagsOf(activity->apart, record->arrayCount).release().ptr();
  });
}

/// A tuple of items, None for null.
static PyObject *tupleOf(PyObject **items, int count) {
  PyObject *tuple = PyTuple_New(count);
  for (int i = 0; tuple && i < count; ++i)
    PyTuple_SET_ITEM(tuple, i, Py_NewRef(items[i] ? items[i] : Py_None));
  return tuple;
}

static PyObject *getValues(PyObject *self, void *) {
  return tupleOf(asRecord(self)->items, asRecord(self)->valueCount);
}

static PyObject *getVersions(PyObject *self, void *) {
  RecordObject *record = asRecord(self);
  if (record->versions || !record->activity)
    return Py_NewRef(record->versions ? record->versions : Py_None);
  return tupleOf(versionsOf(record), record->arrayCount);
}

static int setVersions(PyObject *self, PyObject *value, void *) {
  Py_XSETREF(asRecord(self)->versions, Py_XNewRef(value));
  return 0;
}

void python::bindRecords(py::module_ &m) {
  static PyMethodDef methods[] = {
      {"noted_apart", notedApart, METH_NOARGS,
       "For each array whether it is read and written in different places; "
       "empty if none is."},
      {nullptr, nullptr, 0, nullptr}};
  static PyGetSetDef attributes[] = {
      {"values", getValues, nullptr, nullptr, nullptr},
      {"versions", getVersions, setVersions, nullptr, nullptr},
      {nullptr, nullptr, nullptr, nullptr, nullptr}};
#define WARP_FIELD(name) offsetof(RecordObject, name)
  static PyMemberDef members[] = {
      {"kernel", T_OBJECT, WARP_FIELD(kernel), 0, nullptr},
      {"native", T_OBJECT, WARP_FIELD(native), 0, nullptr},
      {"dim", T_OBJECT, WARP_FIELD(dim), 0, nullptr},
      {"stream", T_OBJECT, WARP_FIELD(stream), 0, nullptr},
      {"place", T_OBJECT, WARP_FIELD(place), READONLY, nullptr},
      {"budget", T_OBJECT, WARP_FIELD(budget), 0, nullptr},
      {"_call", T_OBJECT, WARP_FIELD(call), 0, nullptr},
      {"_event", T_OBJECT, WARP_FIELD(event), 0, nullptr},
      {"_before", T_OBJECT, WARP_FIELD(before), 0, nullptr},
      {"_behind", T_OBJECT, WARP_FIELD(behind), 0, nullptr},
      {"_saved", T_OBJECT, WARP_FIELD(saved), 0, nullptr},
      {"_aliases", T_OBJECT, WARP_FIELD(aliases), 0, nullptr},
      {"_apart", T_OBJECT, WARP_FIELD(apart), 0, nullptr},
      {"_originals", T_OBJECT, WARP_FIELD(originals), READONLY, nullptr},
      {"_made", T_OBJECT, WARP_FIELD(made), 0, nullptr},
      {"_has_gradients", T_BOOL, WARP_FIELD(hasGradients), 0, nullptr},
      {"pending", T_BOOL, WARP_FIELD(pending), 0, nullptr},
      {"device", T_INT, WARP_FIELD(device), 0, nullptr},
      {"block_dim", T_INT, WARP_FIELD(blockDim), 0, nullptr},
      {"__weaklistoffset__", T_PYSSIZET, WARP_FIELD(weak), READONLY, nullptr},
      {nullptr, 0, 0, 0, nullptr}};
#undef WARP_FIELD
  PyType_Slot slots[] = {
      {Py_tp_new, reinterpret_cast<void *>(newRecord)},
      {Py_tp_init, reinterpret_cast<void *>(initRecord)},
      {Py_tp_dealloc, reinterpret_cast<void *>(deallocRecord)},
      {Py_tp_traverse, reinterpret_cast<void *>(traverseRecord)},
      {Py_tp_clear, reinterpret_cast<void *>(clearRecord)},
      {Py_tp_methods, methods},
      {Py_tp_members, members},
      {Py_tp_getset, attributes},
      {Py_tp_doc, const_cast<char *>("A launch on a tape.")},
      {0, nullptr}};
  PyType_Spec spec = {
      "warp._native.Record", sizeof(RecordObject), 0,
      Py_TPFLAGS_DEFAULT | Py_TPFLAGS_BASETYPE | Py_TPFLAGS_HAVE_GC, slots};
  PyObject *type = PyType_FromSpec(&spec);
  if (!type)
    throw py::error_already_set();
  recordBase = reinterpret_cast<PyTypeObject *>(type);
  m.add_object("Record", py::reinterpret_steal<py::object>(type));
  m.def(
      "set_record_type",
      [](py::object type, py::object needs, py::object plainAdjoint) {
        recordType = reinterpret_cast<PyTypeObject *>(type.release().ptr());
        adjointQueries() = {needs.release().ptr(),
                            plainAdjoint.release().ptr()};
      },
      py::arg("type"), py::arg("needs"), py::arg("plain_adjoint"));
  m.def(
      "forget_needs", [] { ++generation; },
      "Adjoints may read other memory from now on.");
  bindLaunchRecorder(m);
  bindReverse(m);
}

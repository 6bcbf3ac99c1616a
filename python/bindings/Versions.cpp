//===- Versions.cpp - Former contents of memory regions -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Versions.h"

#include "KernelObject.h"
#include "Records.h"
#include "RegionFinder.h"

#include <algorithm>
#include <pybind11/stl.h>
#include <structmember.h>

namespace py = pybind11;
using namespace warp;
using namespace warp::python;

//===----------------------------------------------------------------------===//
// The object
//===----------------------------------------------------------------------===//

/// The class in Python, once it is known.
static PyTypeObject *versionType = nullptr;

static PyObject *makeVersion(PyTypeObject *type, PyObject *array,
                             PyObject *copy) {
  PyObject *object = type->tp_alloc(type, 0);
  if (!object)
    return nullptr;
  asVersion(object)->array = Py_NewRef(array);
  asVersion(object)->copy = Py_NewRef(copy);
  asVersion(object)->number = -1;
  return object;
}

static PyObject *newVersion(PyTypeObject *type, PyObject *args, PyObject *) {
  PyObject *array, *copy;
  if (!PyArg_ParseTuple(args, "OO", &array, &copy))
    return nullptr;
  return makeVersion(type, array, copy);
}

static void deallocVersion(PyObject *self) {
  VersionObject *version = asVersion(self);
  if (version->weak)
    PyObject_ClearWeakRefs(self);
  if (version->table) {
    auto &current = (*version->table)->current;
    auto entry = current.find(version->number);
    if (entry != current.end() && entry->second == version)
      (*version->table)->forget(version->number);
    delete version->table;
  }
  if (version->readers) {
    for (Reader &reader : *version->readers) {
      Py_XDECREF(reader.reference);
      Py_XDECREF(reader.budget);
    }
    delete version->readers;
  }
  if (version->records) {
    for (RecordToken *token : *version->records)
      token->drop();
    delete version->records;
  }
  for (PyObject *member :
       {version->array, version->copy, version->region, version->pieces,
        version->ended, version->refused, version->lent, version->successor,
        version->predecessor, version->listeners})
    Py_XDECREF(member);
  PyTypeObject *type = Py_TYPE(self);
  type->tp_free(self);
  Py_DECREF(type);
}

void python::addReader(VersionObject *version, RecordToken *token) {
  if (!version->records)
    version->records = new std::vector<RecordToken *>;
  version->records->push_back(token->share());
}

static void addReader(VersionObject *version, PyObject *reader,
                      PyObject *budget) {
  PyObject *reference = PyWeakref_NewRef(reader, nullptr);
  if (!reference)
    throw py::error_already_set();
  if (!version->readers)
    version->readers = new std::vector<Reader>;
  version->readers->push_back({reference, Py_NewRef(budget)});
}

static PyObject *keepFor(PyObject *self, PyObject *args, PyObject *names) {
  static const char *keywords[] = {"reader", "budget", nullptr};
  PyObject *reader, *budget = Py_None;
  if (!PyArg_ParseTupleAndKeywords(
          args, names, "O|O", const_cast<char **>(keywords), &reader, &budget))
    return nullptr;
  return guarded([&]() -> PyObject * {
    addReader(asVersion(self), reader, budget);
    Py_RETURN_NONE;
  });
}

/// (weak reference, budget) of each.
static PyObject *getReaders(PyObject *self, void *) {
  return guarded([&] {
    py::list list;
    VersionObject *version = asVersion(self);
    if (version->readers)
      for (Reader &reader : *version->readers)
        list.append(py::make_tuple(py::handle(reader.reference),
                                   py::handle(reader.budget)));
    if (version->records)
      for (RecordToken *token : *version->records)
        if (RecordObject *record = token->record)
          list.append(
              py::make_tuple(py::weakref(reinterpret_cast<PyObject *>(record)),
                             py::handle(record->budget)));
    return list.release().ptr();
  });
}

/// Lists are made when they are first asked for.
template <PyObject *VersionObject::*member>
static PyObject *getList(PyObject *self, void *) {
  PyObject *&list = asVersion(self)->*member;
  if (!list)
    list = PyList_New(0);
  return Py_XNewRef(list);
}

//===----------------------------------------------------------------------===//
// Places
//===----------------------------------------------------------------------===//

static PyTypeObject *placeType = nullptr;

PyObject *python::makePlace(PyObject *kernel, PyObject *code, int instruction) {
  PyObject *object = placeType->tp_alloc(placeType, 0);
  if (!object)
    throw py::error_already_set();
  auto *place = reinterpret_cast<PlaceObject *>(object);
  place->kernel = Py_NewRef(kernel);
  place->code = Py_NewRef(code);
  place->instruction = instruction;
  return object;
}

static void deallocPlace(PyObject *self) {
  auto *place = reinterpret_cast<PlaceObject *>(self);
  Py_XDECREF(place->kernel);
  Py_XDECREF(place->code);
  PyTypeObject *type = Py_TYPE(self);
  type->tp_free(self);
  Py_DECREF(type);
}

static PyObject *getLine(PyObject *self, void *) {
  auto *place = reinterpret_cast<PlaceObject *>(self);
  int line = -place->instruction;
  if (line <= 0)
    line = PyCode_Addr2Line(reinterpret_cast<PyCodeObject *>(place->code),
                            place->instruction);
  return PyLong_FromLong(line);
}

static void bindPlace(py::module_ &m) {
  static PyMemberDef members[] = {
      {"kernel", T_OBJECT, offsetof(PlaceObject, kernel), READONLY, nullptr},
      {"code", T_OBJECT, offsetof(PlaceObject, code), READONLY, nullptr},
      {nullptr, 0, 0, 0, nullptr}};
  static PyGetSetDef attributes[] = {
      {"line", getLine, nullptr, nullptr, nullptr},
      {nullptr, nullptr, nullptr, nullptr, nullptr}};
  PyType_Slot slots[] = {
      {Py_tp_dealloc, reinterpret_cast<void *>(deallocPlace)},
      {Py_tp_members, members},
      {Py_tp_getset, attributes},
      {Py_tp_doc, const_cast<char *>("The place of a call that launches.")},
      {0, nullptr}};
  PyType_Spec spec = {"warp._native.Place", sizeof(PlaceObject), 0,
                      Py_TPFLAGS_DEFAULT | Py_TPFLAGS_DISALLOW_INSTANTIATION,
                      slots};
  PyObject *type = PyType_FromSpec(&spec);
  if (!type)
    throw py::error_already_set();
  placeType = reinterpret_cast<PyTypeObject *>(type);
  m.add_object("Place", py::reinterpret_steal<py::object>(type));
}

//===----------------------------------------------------------------------===//
// Writes
//===----------------------------------------------------------------------===//

/// The object that a weak reference is to, null if it is gone.
static py::object targetOf(PyObject *reference) {
#if PY_VERSION_HEX >= 0x030d0000
  PyObject *target = nullptr;
  if (PyWeakref_GetRef(reference, &target) < 0)
    throw py::error_already_set();
  return py::reinterpret_steal<py::object>(target);
#else
  auto target =
      py::reinterpret_borrow<py::object>(PyWeakref_GetObject(reference));
  return target.is_none() ? py::object() : target;
#endif
}

static bool needs(PyObject *reader, VersionObject *version) {
  py::handle self(reinterpret_cast<PyObject *>(version));
  return py::handle(reader).attr("needs")(self).cast<bool>();
}

/// The budget of somebody who has read a version and needs it, null if nobody
/// does. Python may add readers while it is asked.
static py::object findNeed(VersionObject *version) {
  for (size_t i = 0; version->readers && i < version->readers->size(); ++i) {
    const Reader &known = (*version->readers)[i];
    py::object reader = targetOf(known.reference);
    auto budget = py::reinterpret_borrow<py::object>(known.budget);
    if (reader && needs(reader.ptr(), version))
      return budget;
  }
  for (size_t i = 0; version->records && i < version->records->size(); ++i) {
    RecordObject *record = (*version->records)[i]->record;
    if (!record)
      continue;
    auto held = py::reinterpret_borrow<py::object>(
        reinterpret_cast<PyObject *>(record));
    std::optional<bool> known = recordNeeds(record, version);
    if (known ? *known : needs(held.ptr(), version))
      return py::reinterpret_borrow<py::object>(record->budget);
  }
  return py::object();
}

/// The budget of somebody who needs what a version is of, or an earlier one
/// that counts on it; null if nobody does.
static py::object findWish(VersionObject *version) {
  py::object step =
      py::reinterpret_borrow<py::object>(reinterpret_cast<PyObject *>(version));
  while (step) {
    VersionObject *one = asVersion(step.ptr());
    if (py::object budget = findNeed(one))
      return budget;
    if (!one->predecessor || one->predecessor == Py_None)
      return py::object();
    step = targetOf(one->predecessor);
  }
  return py::object();
}

static bool isWanted(VersionObject *version) { return bool(findWish(version)); }

static PyObject *callWanted(PyObject *self, PyObject *) {
  return guarded([&] {
    py::object budget = findWish(asVersion(self));
    return py::make_tuple(bool(budget), budget ? budget : py::none())
        .release()
        .ptr();
  });
}

/// Ends a version before a region is overwritten; false if it does not end.
static bool endVersion(VersionObject *version, VersionTable &table,
                       const Region &written, Writer &by, py::list &pieces) {
  if (version->complete || version->ended)
    return true;
  const Region &own = table.regions[version->number];
  bool isPlain = isIntact(version) &&
                 (!version->listeners || !PyList_GET_SIZE(version->listeners));
  if (isPlain && !own.overlaps(written))
    return false;
  if (isPlain && !isWanted(version)) {
    version->ended = by.mark().release().ptr();
    return true;
  }
  if (!version->region)
    version->region =
        py::cast(Region(table.regions[version->number])).release().ptr();
  py::handle self(reinterpret_cast<PyObject *>(version));
  return self.attr("end")(Region(written), by.event(), pieces).cast<bool>();
}

void VersionMap::end(const std::vector<const Region *> &written, Writer &by) {
  std::vector<int64_t> numbers, found;
  for (const Region *region : written) {
    table->regions.meeting(*region, found);
    numbers.insert(numbers.end(), found.begin(), found.end());
  }
  py::list pieces;
  for (int64_t number : numbers) {
    auto entry = table->current.find(number);
    if (entry == table->current.end())
      continue;
    // Held, since it may lose its last owner meanwhile.
    auto version = py::reinterpret_borrow<py::object>(
        reinterpret_cast<PyObject *>(entry->second));
    for (const Region *region : written)
      if (endVersion(asVersion(version.ptr()), *table, *region, by, pieces)) {
        table->forget(number);
        break;
      }
  }
}

//===----------------------------------------------------------------------===//
// Versions by region
//===----------------------------------------------------------------------===//

py::object VersionMap::observe(PyObject *self, PyObject *array,
                               const Region &region) {
  int64_t number = table->regions.add(region);
  auto entry = table->current.find(number);
  bool isKnown = entry != table->current.end();
  py::object version;
  if (isKnown) {
    version = py::reinterpret_borrow<py::object>(
        reinterpret_cast<PyObject *>(entry->second));
    if (isIntact(entry->second) || !version.attr("changed").cast<bool>())
      return version;
    // The object made from the former one may have ended meanwhile.
    version = py::handle(self).attr("_renew")(version, py::handle(array),
                                              Region(region));
    number = table->regions.add(region);
  } else {
    version = py::reinterpret_steal<py::object>(
        makeVersion(versionType, array, copy.ptr()));
    if (!version)
      throw py::error_already_set();
  }
  asVersion(version.ptr())->number = number;
  if (!asVersion(version.ptr())->table)
    asVersion(version.ptr())->table = new std::shared_ptr<VersionTable>(table);
  table->current[number] = asVersion(version.ptr());
  return version;
}

namespace {
/// `by` of Python, which has an attribute `event`.
class PythonWriter final : public Writer {
public:
  explicit PythonWriter(py::object by) : by(std::move(by)) {}
  py::object mark() override { return event(); }
  py::object event() override { return by.attr("event"); }

private:
  py::object by;
};
} // namespace

static py::list versionsMeeting(const VersionMap &map, const Region &region) {
  std::vector<int64_t> found;
  map.table->regions.meeting(region, found);
  py::list list;
  for (int64_t number : found) {
    auto entry = map.table->current.find(number);
    if (entry == map.table->current.end())
      continue;
    VersionObject *version = entry->second;
    if (!version->region)
      version->region =
          py::cast(Region(map.table->regions[number])).release().ptr();
    list.append(py::reinterpret_borrow<py::object>(
        reinterpret_cast<PyObject *>(version)));
  }
  return list;
}

static void bindMap(py::module_ &m) {
  py::class_<VersionMap, std::shared_ptr<VersionMap>>(
      m, "VersionMap", "The current versions of all regions.")
      .def(py::init<py::object>(), py::arg("copy"))
      .def(
          "observe_region",
          [](py::object self, py::object array, const Region &region) {
            return self.cast<VersionMap &>().observe(self.ptr(), array.ptr(),
                                                     region);
          },
          py::arg("array"), py::arg("region"))
      .def(
          "end",
          [](VersionMap &map, const std::vector<Region> &regions,
             py::object by) {
            std::vector<const Region *> written;
            for (const Region &region : regions)
              written.push_back(&region);
            PythonWriter writer(std::move(by));
            map.end(written, writer);
          },
          py::arg("regions"), py::arg("by"),
          "Ends the versions of regions that share bytes with these.")
      .def("meeting", &versionsMeeting, py::arg("region"),
           "The versions of regions that share bytes with this one.")
      .def("__len__",
           [](const VersionMap &map) { return map.table->current.size(); })
      .def("clear", [](VersionMap &map) {
        map.table = std::make_shared<VersionTable>();
      });
}

void python::bindVersions(py::module_ &m) {
  static PyMethodDef methods[] = {
      {"keep_for", asMethod(keepFor), METH_VARARGS | METH_KEYWORDS,
       "keep_for(reader, budget=None)\n\nAsks for copies before the memory is "
       "overwritten, if `reader.needs` it then."},
      {"_wanted", callWanted, METH_NOARGS,
       "True if a reader needs the version, and the budget that a copy of it "
       "counts for."},
      {nullptr, nullptr, 0, nullptr}};
  static PyGetSetDef attributes[] = {
      {"pieces", getList<&VersionObject::pieces>, nullptr, nullptr, nullptr},
      {"_listeners", getList<&VersionObject::listeners>, nullptr, nullptr,
       nullptr},
      {"_readers", getReaders, nullptr, nullptr, nullptr},
      {nullptr, nullptr, nullptr, nullptr, nullptr}};
#define WARP_FIELD(name) offsetof(VersionObject, name)
  static PyMemberDef members[] = {
      {"array", T_OBJECT, WARP_FIELD(array), READONLY, nullptr},
      {"_copy", T_OBJECT, WARP_FIELD(copy), READONLY, nullptr},
      {"region", T_OBJECT, WARP_FIELD(region), 0, nullptr},
      {"_ended", T_OBJECT, WARP_FIELD(ended), 0, nullptr},
      {"refused", T_OBJECT, WARP_FIELD(refused), 0, nullptr},
      {"lent", T_OBJECT, WARP_FIELD(lent), 0, nullptr},
      {"successor", T_OBJECT, WARP_FIELD(successor), 0, nullptr},
      {"predecessor", T_OBJECT, WARP_FIELD(predecessor), 0, nullptr},
      {"_rest", T_LONGLONG, WARP_FIELD(rest), 0, nullptr},
      {"complete", T_BOOL, WARP_FIELD(complete), 0, nullptr},
      {"__weaklistoffset__", T_PYSSIZET, WARP_FIELD(weak), READONLY, nullptr},
      {nullptr, 0, 0, 0, nullptr}};
#undef WARP_FIELD
  PyType_Slot slots[] = {
      {Py_tp_new, reinterpret_cast<void *>(newVersion)},
      {Py_tp_dealloc, reinterpret_cast<void *>(deallocVersion)},
      {Py_tp_methods, methods},
      {Py_tp_members, members},
      {Py_tp_getset, attributes},
      {Py_tp_doc,
       const_cast<char *>("Contents of a region of memory at one time.")},
      {0, nullptr}};
  PyType_Spec spec = {"warp._native.Version", sizeof(VersionObject), 0,
                      Py_TPFLAGS_DEFAULT | Py_TPFLAGS_BASETYPE, slots};
  PyObject *type = PyType_FromSpec(&spec);
  if (!type)
    throw py::error_already_set();
  m.add_object("Version", py::reinterpret_steal<py::object>(type));
  m.def("set_version_type", [](py::object type) {
    versionType = reinterpret_cast<PyTypeObject *>(type.release().ptr());
  });
  bindPlace(m);
  bindMap(m);
}

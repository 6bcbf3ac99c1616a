//===- Recorder.cpp - Launches while a tape observes ----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The steps of a launch that is recorded: arguments are packed; which elements
// it touches follows from them (or is known from the last launch with the same
// arguments); versions of what it writes end; it runs; versions of what it has
// touched are noted with it. Before the first version ends, anything that is
// not ordinary sends the launch back to Python.
//
//===----------------------------------------------------------------------===//

#include "Records.h"

#include <algorithm>
#include <cstring>
#include <pybind11/stl.h>
#include <tuple>
#include <utility>

namespace py = pybind11;
using namespace warp;
using namespace warp::python;

//===----------------------------------------------------------------------===//
// Kernels
//===----------------------------------------------------------------------===//

LaunchRecorder::LaunchRecorder(py::object kernel, py::object given)
    : RegionFinder(std::move(kernel)) {
  const std::vector<Param> &params = this->kernel()->kernel->parameters();
  bool hasStructs = !given.is_none();
  for (size_t i = 0; i < params.size(); ++i) {
    if (params[i].kind == Param::Kind::Array && !hasStructs)
      arrays.push_back(i);
    else if (params[i].kind == Param::Kind::Composite ||
             params[i].kind == Param::Kind::Struct)
      composites.push_back(i);
  }
  if (hasStructs)
    for (py::handle field : given) {
      auto [position, type, name] =
          field.cast<std::tuple<size_t, py::object, py::object>>();
      fields.push_back({position, type, name});
      arrays.push_back(params.size() + arrays.size());
    }
  isEligible =
      arrays.size() == arrayAccesses().size() && arrays.size() <= mostArrays;
  for (size_t i = 0; isEligible && i < arrays.size(); ++i) {
    const Access &access = arrayAccesses()[i];
    bool writes = access.stored || access.combined;
    written |= ArraySet(writes) << i;
    looksBack |= access.fetched || (access.loaded && writes);
  }
}

Activity &LaunchRecorder::activity(ArraySet active, ArraySet apart) {
  for (auto &known : activities)
    if (known->active == active && known->apart == apart)
      return *known;
  activities.push_back(std::make_unique<Activity>());
  activities.back()->active = active;
  activities.back()->apart = apart;
  return *activities.back();
}

std::shared_ptr<const KnownRegions>
LaunchRecorder::regions(const LaunchDim &dim, const char *params) {
  std::string_view bytes(params + firstArgument,
                         kernel()->kernel->parameterSize() - firstArgument);
  if (last && last->params == bytes && last->dim.rank == dim.rank &&
      !std::memcmp(last->dim.extent, dim.extent, sizeof(dim.extent)))
    return last;
  auto found = std::make_shared<KnownRegions>();
  found->params = bytes;
  found->dim = dim;
  findPacked(dim, params, found->regions);
  found->hasAliases =
      written && arrays.size() > 1 && !found->regions.meetings().empty();
  if (looksBack) {
    std::vector<bool> flags = found->regions.apart();
    for (size_t i = 0; i < flags.size(); ++i)
      found->apart |= ArraySet(flags[i]) << i;
  }
  last = found;
  return found;
}

/// A function of Python, for as long as the process lives.
static PyObject *importFunction(const char *module, const char *name) {
  py::object function = py::module_::import(module).attr(name);
  return function.release().ptr();
}

//===----------------------------------------------------------------------===//
// Places
//===----------------------------------------------------------------------===//

/// Files below it are the package's own.
static std::string packageFolder;

static bool isOurs(PyCodeObject *code) {
  Py_ssize_t size = 0;
  const char *file = PyUnicode_AsUTF8AndSize(code->co_filename, &size);
  if (!file) {
    PyErr_Clear();
    return false;
  }
  return size_t(size) >= packageFolder.size() &&
         !std::memcmp(file, packageFolder.data(), packageFolder.size());
}

/// The innermost call that is not the package's.
static py::object callingPlace(PyObject *kernel) {
  auto frame = py::reinterpret_steal<py::object>(reinterpret_cast<PyObject *>(
      PyThreadState_GetFrame(PyThreadState_Get())));
  py::object code;
  while (frame) {
    auto *raw = reinterpret_cast<PyFrameObject *>(frame.ptr());
    code = py::reinterpret_steal<py::object>(
        reinterpret_cast<PyObject *>(PyFrame_GetCode(raw)));
    if (!isOurs(reinterpret_cast<PyCodeObject *>(code.ptr())))
      break;
    auto outer = py::reinterpret_steal<py::object>(
        reinterpret_cast<PyObject *>(PyFrame_GetBack(raw)));
    if (!outer)
      break;
    frame = std::move(outer);
  }
  int instruction = -1;
  if (frame) {
    auto *raw = reinterpret_cast<PyFrameObject *>(frame.ptr());
#if PY_VERSION_HEX >= 0x030B0000
    instruction = PyFrame_GetLasti(raw);
#else
    instruction = -PyFrame_GetLineNumber(raw);
#endif
  }
  if (!code)
    code = py::none();
  return py::reinterpret_steal<py::object>(
      makePlace(kernel, code.ptr(), instruction));
}

namespace {
/// A launch, as what ends versions.
class LaunchWriter final : public Writer {
public:
  explicit LaunchWriter(PyObject *kernel) : kernel(kernel) {}
  py::object mark() override {
    if (!place)
      place = callingPlace(kernel);
    return place;
  }
  py::object event() override {
    static PyObject *makeEvent =
        importFunction("warp._src.arrays.versions", "event_of");
    return py::handle(makeEvent)(mark());
  }

private:
  PyObject *kernel;
  py::object place;
};
} // namespace

//===----------------------------------------------------------------------===//
// Launches
//===----------------------------------------------------------------------===//

namespace {
/// The arguments of a launch, and room for arrays in structs and for a version
/// of each array, until a record takes them.
class Arguments {
public:
  Arguments(const Items &inputs, const Items &outputs,
            const LaunchRecorder &recorder)
      : count(inputs.size() + outputs.size()), arrays(recorder.arrays.size()),
        all(count + recorder.fields.size() + arrays),
        items(new PyObject *[all]()) {
    for (size_t i = 0; i < count; ++i)
      items[i] =
          Py_NewRef(i < inputs.size() ? inputs[i] : outputs[i - inputs.size()]);
  }
  Arguments(const Arguments &) = delete;
  ~Arguments() {
    for (size_t i = 0; items && i < all; ++i)
      Py_XDECREF(items[i]);
    delete[] items;
  }

  size_t size() const { return count; }
  PyObject **data() { return items; }
  PyObject *&operator[](size_t i) { return items[i]; }
  void handTo(RecordObject *record) {
    record->items = std::exchange(items, nullptr);
    record->itemCount = static_cast<int>(all);
    record->valueCount = static_cast<int>(count);
    record->arrayCount = static_cast<int>(arrays);
  }

private:
  size_t count, arrays, all;
  PyObject **items;
};
} // namespace

/// Finds the arrays in structs; false if one of these is of another class.
static bool findFields(const LaunchRecorder &recorder, Arguments &values) {
  for (size_t i = 0; i < recorder.fields.size(); ++i) {
    const StructField &field = recorder.fields[i];
    PyObject *value = values[field.position];
    if (field.name.is_none()) {
      values[recorder.arrays[i]] = Py_NewRef(value);
      continue;
    }
    if (reinterpret_cast<PyObject *>(Py_TYPE(value)) != field.type.ptr())
      return false;
    PyObject *found = PyObject_GetAttr(value, field.name.ptr());
    if (!found)
      throw py::error_already_set();
    values[recorder.arrays[i]] = found;
  }
  return true;
}

/// True if all arrays are such, of that device and rank.
static bool areOrdinary(const LaunchRecorder &recorder, Arguments &values,
                        int device) {
  const auto &params = recorder.kernel()->kernel->parameters();
  if (values.size() != params.size() || !findFields(recorder, values))
    return false;
  for (size_t i = 0; i < recorder.arrays.size(); ++i) {
    PyObject *value = values[recorder.arrays[i]];
    if (!isArray(value) || asArray(value)->device != device)
      return false;
    // Fields have the rank that they were declared with.
    bool isField = i < recorder.fields.size();
    size_t position =
        isField ? recorder.fields[i].position : recorder.arrays[i];
    if (params[position].kind == Param::Kind::Array &&
        asArray(value)->descriptor.ndim != params[position].rank)
      return false;
  }
  return true;
}

/// Lets a record have copies of what the caller may change, and gives the
/// structs among them; null without any.
static py::object copyComposites(const LaunchRecorder &recorder,
                                 Arguments &values) {
  py::object originals;
  if (recorder.composites.empty())
    return originals;
  static PyObject *copy = importFunction("copy", "copy");
  const auto &params = recorder.kernel()->kernel->parameters();
  for (size_t position : recorder.composites) {
    PyObject *made = PyObject_CallOneArg(copy, values[position]);
    if (!made)
      throw py::error_already_set();
    if (params[position].kind == Param::Kind::Struct) {
      if (!originals)
        originals = py::list();
      PyList_Append(originals.ptr(), values[position]);
    }
    Py_SETREF(values[position], made);
  }
  return originals;
}

/// Notes the versions of what a launch has touched, with the record as a
/// reader.
static void observe(PyObject *memory, VersionMap &map,
                    const LaunchRecorder &recorder, const KnownRegions &known,
                    RecordObject *record) {
  for (size_t i = 0; i < recorder.arrays.size(); ++i) {
    const ArrayRegions &regions = known.regions.arrays[i];
    PyObject *array = record->items[recorder.arrays[i]];
    const ArrayDescriptor &descriptor = asArray(array)->descriptor;
    if (std::count(descriptor.shape, descriptor.shape + descriptor.ndim, 0))
      continue;
    // Writes elsewhere are of no concern to the adjoint.
    bool reads = (known.apart >> i & 1) || regions.written.blocks.empty();
    py::object version =
        reads ? map.observe(memory, array, regions.read)
        : regions.read.blocks.empty()
            ? map.observe(memory, array, regions.written)
            : map.observe(memory, array, known.regions.touched(i));
    if (record->budget != Py_None)
      addReader(asVersion(version.ptr()), record->token);
    versionsOf(record)[i] = version.release().ptr();
  }
}

namespace {
/// Arguments of `launch_recorded`.
struct Recording {
  PyObject *recorder, *memory, *records, *budget, *kernel, *dim, *inputs,
      *outputs;
  int device, blockDim;
};
} // namespace

/// True if all that the launch has to keep for its adjoint are arrays as they
/// are before it.
static bool canPreserve(const Activity &activity,
                        const LaunchRecorder &recorder,
                        const KnownRegions &known, Arguments &values) {
  if (!activity.isPreserving)
    return false;
  for (size_t i = 0; i < recorder.arrays.size(); ++i) {
    if (!(activity.preserved >> i & 1))
      continue;
    const ArrayDescriptor &array =
        asArray(values[recorder.arrays[i]])->descriptor;
    if (known.regions.arrays[i].read.blocks.empty() ||
        std::count(array.shape, array.shape + array.ndim, 0))
      return false;
  }
  return true;
}

/// A record without arguments and versions.
static py::object begin(const Recording &given, const LaunchRecorder &recorder,
                        Activity *activity) {
  auto made = py::reinterpret_steal<py::object>(makeRecord());
  if (!made)
    throw py::error_already_set();
  RecordObject *record = asRecord(made.ptr());
  record->kernel = Py_NewRef(given.kernel);
  record->native = Py_NewRef(reinterpret_cast<PyObject *>(recorder.kernel()));
  record->dim = Py_NewRef(given.dim);
  record->recorder = Py_NewRef(given.recorder);
  record->budget = Py_NewRef(given.budget);
  record->activity = activity;
  record->device = given.device;
  record->blockDim = given.blockDim;
  record->hasGradients = activity != nullptr;
  if (activity && (given.budget != Py_None || activity->preserved))
    record->token = new RecordToken{record};
  return made;
}

/// Sees to it that what the launch overwrites is kept where its adjoint reads
/// that.
static void observeFormer(PyObject *memory, VersionMap &map,
                          const LaunchRecorder &recorder,
                          const KnownRegions &known, Arguments &values,
                          RecordObject *record) {
  py::dict former;
  record->before = Py_NewRef(former.ptr());
  for (size_t i = 0; i < recorder.arrays.size(); ++i) {
    if (!(record->activity->preserved >> i & 1))
      continue;
    py::object version = map.observe(memory, values[recorder.arrays[i]],
                                     known.regions.arrays[i].read);
    addReader(asVersion(version.ptr()), record->token);
    former[py::int_(i)] = version;
  }
}

static bool launchRecorded(const Recording &given) {
  auto &recorder = py::handle(given.recorder).cast<LaunchRecorder &>();
  if (!recorder.isEligible || capturesInProgress)
    return false;
  KernelObject *object = recorder.kernel();
  Kernel &kernel = *object->kernel;
  LaunchDim dim = readDim(kernel, given.dim);
  Items inputs(given.inputs), outputs(given.outputs);
  bool isRecorded = given.records != Py_None;
  Arguments values(inputs, outputs, recorder);
  if (!areOrdinary(recorder, values, given.device))
    return false;
  py::object originals;
  if (isRecorded)
    originals = copyComposites(recorder, values);
  Block block(kernel.parameterSize());
  std::vector<py::object> keep;
  for (size_t i = 0; i < values.size(); ++i)
    object->packer->pack(i, values[i], given.device, block.data(), keep);
  if (!keep.empty())
    return false;
  auto known = recorder.regions(dim, block.data());
  ArraySet active = isRecorded ? activeArrays(recorder, values.data()) : 0;
  Activity *activity = nullptr;
  if (active) {
    if (known->hasAliases)
      return false;
    activity = &recorder.activity(active, known->apart);
    if (recorder.looksBack) {
      findNeeds(*activity, given.kernel, recorder);
      if (!activity->isPlain &&
          !canPreserve(*activity, recorder, *known, values))
        return false;
    }
  }
  auto &map = py::handle(given.memory).cast<VersionMap &>();
  LaunchWriter writer(given.kernel);
  py::object made;
  if (isRecorded)
    made = begin(given, recorder, activity);
  if (activity && activity->preserved)
    observeFormer(given.memory, map, recorder, *known, values,
                  asRecord(made.ptr()));
  std::vector<const Region *> written;
  if (!map.table->current.empty())
    for (const ArrayRegions &array : known->regions.arrays)
      if (!array.written.blocks.empty())
        written.push_back(&array.written);
  if (!written.empty())
    map.end(written, writer);
  py::object place = isRecorded ? writer.mark() : py::object();
  launchPacked(
      kernel, given.device, dim, block.data(), nullptr, given.blockDim,
      [&] { return py::reinterpret_borrow<py::object>(given.recorder); });
  if (!isRecorded)
    return true;
  RecordObject *record = asRecord(made.ptr());
  values.handTo(record);
  record->originals = originals.release().ptr();
  record->place = place.release().ptr();
  if (active)
    observe(given.memory, map, recorder, *known, record);
  if (PyList_Append(given.records, made.ptr()))
    throw py::error_already_set();
  return true;
}

static PyObject *callLaunchRecorded(PyObject *, PyObject *const *args,
                                    Py_ssize_t count) {
  if (count != 10)
    return PyErr_Format(PyExc_TypeError, "expects 10 arguments, but got %zd",
                        count);
  return guarded([&]() -> PyObject * {
    Recording given{args[0],
                    args[1],
                    args[2],
                    args[3],
                    args[4],
                    args[5],
                    args[6],
                    args[7],
                    static_cast<int>(PyLong_AsLong(args[8])),
                    static_cast<int>(PyLong_AsLong(args[9]))};
    if (PyErr_Occurred())
      throw py::error_already_set();
    return Py_NewRef(launchRecorded(given) ? Py_True : Py_False);
  });
}

void python::bindLaunchRecorder(py::module_ &m) {
  py::class_<LaunchRecorder>(m, "LaunchRecorder",
                             "Facts of a kernel for recording its launches.")
      .def(py::init<py::object, py::object>(), py::arg("kernel"),
           py::arg("fields") = py::none())
      .def_readonly("is_eligible", &LaunchRecorder::isEligible);
  static PyMethodDef functions[] = {
      {"launch_recorded", asMethod(callLaunchRecorded), METH_FASTCALL,
       "launch_recorded(recorder, memory, records, budget, kernel, dim, "
       "inputs, "
       "outputs, device, block_dim)\n\nRuns a launch that a tape observes, and "
       "adds it to `records` if that is not None. False, and nothing is done, "
       "if it is not an ordinary one."},
      {nullptr, nullptr, 0, nullptr}};
  if (PyModule_AddFunctions(m.ptr(), functions))
    throw py::error_already_set();
  m.def("set_package_folder",
        [](const std::string &folder) { packageFolder = folder; });
}

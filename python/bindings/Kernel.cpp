//===- Kernel.cpp - warp._native.Kernel -----------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The type: made from a module, asked for its parameters, its text and its
// compile times. Launch.cpp has what runs it.
//
//===----------------------------------------------------------------------===//

#include "Gil.h"
#include "KernelObject.h"
#include "LaunchCall.h"

#include "warp/Builder.h"
#include "warp/Translation.h"
#include "warp/Version.h"

#include <pybind11/stl.h>

namespace py = pybind11;
using namespace warp;
using namespace warp::python;

PyTypeObject *python::kernelType = nullptr;

static PyObject *newKernel(PyTypeObject *type, PyObject *args,
                           PyObject *names) {
  static const char *keywords[] = {
      "module",      "name",        "debug",         "fast_math",
      "lineinfo",    "opt_level",   "block_dim",     "max_registers",
      "max_threads", "min_blocks",  "deterministic", "same_on_devices",
      "lanes",       "quick_first", "ordered_slots", nullptr};
  PyObject *module;
  const char *name;
  KernelOptions options;
  int debug = 0, fastMath = 0, lineinfo = 0, deterministic = 0,
      sameOnDevices = 0, quickFirst = 0;
  long long orderedSlots = 0;
  if (!PyArg_ParseTupleAndKeywords(
          args, names, "Os|$pppiiiiippipL", const_cast<char **>(keywords),
          &module, &name, &debug, &fastMath, &lineinfo, &options.optLevel,
          &options.blockDim, &options.maxRegisters, &options.maxThreads,
          &options.minBlocks, &deterministic, &sameOnDevices, &options.lanes,
          &quickFirst, &orderedSlots))
    return nullptr;
  options.deterministic = deterministic;
  options.sameOnDevices = sameOnDevices;
  options.quickFirst = quickFirst;
  options.orderedSlots = orderedSlots;
  options.debug = debug;
  options.fastMath = fastMath;
  options.lineinfo = lineinfo;
  return guarded([&]() -> PyObject * {
    py::handle source(module);
    auto kernel = py::isinstance<Translation>(source)
                      ? std::make_unique<Kernel>(
                            source.cast<const Translation &>(), name, options)
                      : std::make_unique<Kernel>(source.cast<const Module &>(),
                                                 name, options);
    auto packer = std::make_unique<Packer>(*kernel);
    PyObject *self = type->tp_alloc(type, 0);
    if (!self)
      return nullptr;
    asKernel(self)->kernel = kernel.release();
    asKernel(self)->packer = packer.release();
    return self;
  });
}

static void deallocKernel(PyObject *self) {
  PyTypeObject *type = Py_TYPE(self);
  delete asKernel(self)->packer;
  delete asKernel(self)->kernel;
  type->tp_free(self);
  Py_DECREF(type);
}

static PyObject *getName(PyObject *self, void *) {
  return PyUnicode_FromString(asKernel(self)->kernel->name().c_str());
}

static PyObject *getModule(PyObject *self, void *) {
  return guarded([&] {
    return py::cast(asKernel(self)->kernel->module()).release().ptr();
  });
}

static const char *kindName(Param::Kind kind) {
  switch (kind) {
  case Param::Kind::Scalar:
    return "scalar";
  case Param::Kind::Composite:
    return "composite";
  case Param::Kind::Array:
    return "array";
  case Param::Kind::Struct:
    return "struct";
  }
  return "";
}

static PyObject *getParameters(PyObject *self, void *) {
  return guarded([&] {
    py::list list;
    for (const Param &param : asKernel(self)->kernel->parameters())
      list.append(py::make_tuple(param.name, kindName(param.kind), param.type,
                                 param.offset, param.size, param.rank,
                                 param.element));
    return list.release().ptr();
  });
}

static PyObject *getAccesses(PyObject *self, void *) {
  return guarded([&] {
    py::list list;
    for (const Access &access : asKernel(self)->kernel->arrayAccesses())
      list.append(py::make_tuple(access.loaded, access.stored, access.combined,
                                 access.fetched, access.line));
    return list.release().ptr();
  });
}

static PyObject *printIr(PyObject *self, PyObject *args, PyObject *names) {
  static const char *keywords[] = {"stage", "arch", "rank", nullptr};
  const char *stage;
  int arch = 0, rank = 0;
  if (!PyArg_ParseTupleAndKeywords(args, names, "s|ii",
                                   const_cast<char **>(keywords), &stage, &arch,
                                   &rank))
    return nullptr;
  return guarded([&] {
    Kernel &kernel = *asKernel(self)->kernel;
    std::string text;
    {
      warp::python::Unlocked unlocked;
      const Module &module = kernel.module();
      if (!rank)
        rank = threadRank(module);
      text = emitText(module, kernel.optionsFor(arch, rank), stage);
    }
    return py::str(text).release().ptr();
  });
}

/// A dictionary of the facts of a schedule that are numbers or flags.
static py::dict factsOf(const Schedule &schedule) {
  py::dict facts;
  Schedule::visit(schedule, [&](const FactInfo &fact, const auto &value) {
    if constexpr (std::is_arithmetic_v<std::decay_t<decltype(value)>>)
      facts[fact.name] = value;
  });
  return facts;
}

static PyObject *schedules(PyObject *self, PyObject *args, PyObject *names) {
  static const char *keywords[] = {"device", "arch", "dim", nullptr};
  int device = defaultDevice, arch = 0;
  PyObject *extents = Py_None;
  if (!PyArg_ParseTupleAndKeywords(args, names, "|iiO",
                                   const_cast<char **>(keywords), &device,
                                   &arch, &extents))
    return nullptr;
  return guarded([&] {
    Kernel &kernel = *asKernel(self)->kernel;
    LaunchDim dim;
    if (extents != Py_None)
      dim = readDim(kernel, extents);
    std::vector<LaunchSchedule> found;
    {
      py::gil_scoped_release unlocked;
      found =
          kernel.schedules(device, arch, extents == Py_None ? nullptr : &dim);
    }
    py::list list;
    for (const LaunchSchedule &schedule : found) {
      py::list choices;
      for (const Choice &choice : schedule.choices)
        choices.append(py::make_tuple(choice.what, choice.value, choice.reason,
                                      choice.line));
      list.append(py::make_tuple(schedule.launch, choices,
                                 factsOf(schedule.schedule)));
    }
    return list.release().ptr();
  });
}

static PyObject *compileTimes(PyObject *self, PyObject *) {
  return guarded([&] {
    py::dict times;
    for (const auto &[phase, milliseconds] :
         asKernel(self)->kernel->compileTimes())
      times[py::str(phase)] = milliseconds;
    return times.release().ptr();
  });
}

static void keepTranslation(const std::string &name, const py::object &object,
                            const py::bytes &bytes,
                            std::shared_ptr<TranslationClaim> claim) {
  std::string notes = bytes;
  if (Py_TYPE(object.ptr()) != kernelType)
    throw py::type_error("expects a kernel");
  Kernel &kernel = *asKernel(object.ptr())->kernel;
  warp::python::Unlocked unlocked;
  kernel.storeTranslation(name, std::move(notes), std::move(claim));
}

static void bindTranslation(py::module_ &m) {
  py::class_<Translation>(m, "Translation",
                          "The translation of a kernel, from the cache.")
      .def_property_readonly("notes", [](const Translation &translation) {
        return py::bytes(translation.notes);
      });
  py::class_<TranslationClaim, std::shared_ptr<TranslationClaim>>(
      m, "TranslationClaim",
      "The right of this process to translate what has a name, as long as the "
      "object lives; waits for another process of the host that has it.")
      .def(py::init<const std::string &>(), py::arg("name"),
           py::call_guard<warp::python::Unlocked>())
      .def_property_readonly("has_waited", &TranslationClaim::hasWaited);
  m.def("find_translation", findTranslation, py::arg("name"),
        "The translation of a name of 64 hexadecimal digits, or None.");
  m.def("store_translation", keepTranslation, py::arg("name"),
        py::arg("kernel"), py::arg("notes"), py::arg("claim") = nullptr,
        "Writes the translation of a kernel to the cache, and ends the claim; "
        "while launches wait for their code, another thread does.");
  m.attr("VERSION") = version();
  m.def("build_id", buildId, "Digits that differ between builds.");
}

void python::bindKernel(py::module_ &m) {
  static PyMethodDef methods[] = {
      {"launch", asMethod(launch), METH_FASTCALL,
       "launch(dim, inputs, outputs=None, device=-1, stream=None, "
       "block_dim=0)\n\nRuns the kernel; arguments are positional."},
      {"launch_adjoint", asMethod(launchAdjoint), METH_FASTCALL,
       "launch_adjoint(known, array, dim, inputs, outputs, adj_inputs, "
       "adj_outputs, device, block_dim)\n\nRuns the adjoint that `known` has "
       "for the set of arrays with gradients, all of the class `array`; False "
       "if it has none, or if the launch takes more than that."},
      {"evaluate", asMethod(evaluate), METH_FASTCALL,
       "evaluate(inputs, outputs)\n\nRuns one thread on the CPU, at once also "
       "while a graph is being recorded."},
      {"ir", asMethod(printIr), METH_VARARGS | METH_KEYWORDS,
       "ir(stage, arch=0, rank=0)\n\nText of a stage: warp, thread, llvm, "
       "ptx or asm; for as many dimensions as the kernel asks for, or rank."},
      {"schedules", asMethod(schedules), METH_VARARGS | METH_KEYWORDS,
       "schedules(device=-1, arch=0, dim=None)\n\nWhat was decided about each "
       "kind of launch: (kind, [(what, value, reason, line)])."},
      {"compile_times", compileTimes, METH_NOARGS,
       "Milliseconds by phase of what was compiled so far."},
      {nullptr, nullptr, 0, nullptr}};
  static PyGetSetDef attributes[] = {
      {"name", getName, nullptr, "Name of the kernel.", nullptr},
      {"module", getModule, nullptr,
       "The module that the kernel is compiled from.", nullptr},
      {"parameters", getParameters, nullptr,
       "(name, kind, type, offset, size, rank, element) of each.", nullptr},
      {"accesses", getAccesses, nullptr,
       "(loaded, stored, combined, fetched, line of the first write) of each "
       "array in the arguments.",
       nullptr},
      {nullptr, nullptr, nullptr, nullptr, nullptr}};
  PyType_Slot slots[] = {
      {Py_tp_new, reinterpret_cast<void *>(newKernel)},
      {Py_tp_dealloc, reinterpret_cast<void *>(deallocKernel)},
      {Py_tp_methods, methods},
      {Py_tp_getset, attributes},
      {Py_tp_doc, const_cast<char *>("A kernel that can be launched.")},
      {0, nullptr}};
  PyType_Spec spec = {"warp._native.Kernel", sizeof(KernelObject), 0,
                      Py_TPFLAGS_DEFAULT, slots};
  PyObject *type = PyType_FromSpec(&spec);
  if (!type)
    throw py::error_already_set();
  kernelType = reinterpret_cast<PyTypeObject *>(type);
  m.add_object("Kernel", py::reinterpret_steal<py::object>(type));
  bindTranslation(m);
  bindPackedLaunch(m);
}

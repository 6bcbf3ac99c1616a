//===- SavedModule.cpp - Compiling ahead of launches ----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Functions on kernels that do not launch them: compile for a device, save to
// and load from files, ask what the machine code uses.
//
//===----------------------------------------------------------------------===//

#include "Gil.h"
#include "KernelObject.h"

#include "warp/KernelCache.h"
#include "warp/SavedModule.h"

#include <pybind11/stl.h>

namespace py = pybind11;
using namespace warp;
using namespace warp::python;

using Named = std::pair<py::object, std::string>;

static Kernel &kernelOf(const py::handle &object) {
  if (Py_TYPE(object.ptr()) != kernelType)
    throw py::type_error("expects a kernel");
  return *asKernel(object.ptr())->kernel;
}

static void saveModule(const std::string &path, const std::string &name,
                       const std::vector<Named> &kernels, int arch,
                       int device) {
  SavedModule module;
  module.name = name;
  for (const auto &[object, savedName] : kernels) {
    Kernel &kernel = kernelOf(object);
    warp::python::Unlocked unlocked;
    module.kernels.push_back(kernel.save(arch, device));
    module.kernels.back().name = savedName;
  }
  module.save(path);
}

/// Attaches the code of a name; whether there is any.
static bool attach(const SavedModule &module, const py::object &object,
                   const std::string &name) {
  Kernel &kernel = kernelOf(object);
  bool found = false;
  for (const SavedKernel &saved : module.kernels) {
    if (saved.name != name)
      continue;
    if (saved.target == "cpu")
      checkProcessor(saved);
    kernel.attach(saved);
    found = true;
  }
  return found;
}

static py::bytes bytesOf(const Code &code) {
  return py::bytes(code.binary.data(), code.binary.size());
}

static py::list describeKernels(const SavedModule &module) {
  py::list list;
  for (const SavedKernel &kernel : module.kernels)
    list.append(
        py::make_tuple(kernel.name, kernel.target, kernel.variants.size()));
  return list;
}

/// The code of all variants, with the launches that it fits.
static py::list describeCodes(const SavedModule &module) {
  py::list list;
  for (const SavedKernel &kernel : module.kernels)
    for (const SavedVariant &variant : kernel.variants) {
      py::dict one;
      one["kernel"] = kernel.name;
      one["target"] = kernel.target;
      one["processor"] = kernel.processor;
      one["rank"] = variant.rank;
      one["packed"] = variant.packed;
      one["index32"] = variant.index32;
      one["block_dim"] = kernel.target == "cpu" ? 0 : variant.blockDim;
      one["entry"] = variant.code.entry;
      one["code"] = bytesOf(variant.code);
      list.append(one);
    }
  return list;
}

/// Entry and code of a file of the kernel cache; None if it is no such file, or
/// another release's.
static py::object readCached(const std::string &bytes) {
  constexpr size_t keyBegin = 12, keyLength = 64;
  if (bytes.size() < keyBegin + keyLength)
    return py::none();
  std::optional<Code> code =
      deserialize(bytes.substr(keyBegin, keyLength), bytes);
  if (!code)
    return py::none();
  return py::make_tuple(code->entry, bytesOf(*code));
}

static py::dict propertiesOf(const py::object &object, int device,
                             int blockDim) {
  Kernel &kernel = kernelOf(object);
  CudaProperties found;
  {
    warp::python::Unlocked unlocked;
    found = kernel.cudaProperties(device, blockDim);
  }
  py::dict result;
  result["register_count"] = found.registers;
  result["local_memory_size"] = found.localMemory;
  result["shared_memory_size"] = found.sharedMemory;
  result["constant_memory_size"] = found.constantMemory;
  result["max_threads_per_block"] = found.maxThreads;
  result["binary_version"] = found.binaryVersion;
  result["block_dim"] = found.blockDim;
  result["blocks_per_multiprocessor"] = found.blocksPerMultiprocessor;
  result["occupancy"] = found.occupancy;
  return result;
}

void python::bindSavedModule(py::module_ &m) {
  m.def(
      "load_kernel",
      [](const py::object &object, int device, int blockDim) {
        Kernel &kernel = kernelOf(object);
        warp::python::Unlocked unlocked;
        kernel.load(device, blockDim);
      },
      py::arg("kernel"), py::arg("device"), py::arg("block_dim") = 0,
      "Compiles and loads what an ordinary launch needs.");
  m.def(
      "load_kernels",
      [](const std::vector<std::tuple<py::object, int, int>> &jobs,
         int threads) {
        std::vector<Kernel::LoadRequest> requests;
        for (const auto &[object, device, blockDim] : jobs)
          requests.push_back({&kernelOf(object), device, blockDim});
        warp::python::Unlocked unlocked;
        Kernel::load(requests, threads);
      },
      py::arg("jobs"), py::arg("threads") = 0,
      "The same for each (kernel, device, block_dim), on so many threads at "
      "most; 0 is one per processor.");
  m.def("save_module", saveModule, py::arg("path"), py::arg("name"),
        py::arg("kernels"), py::arg("arch"), py::arg("device") = defaultDevice,
        "Writes the code of (kernel, name) pairs; arch 0 is the CPU.");
  m.def("cuda_kernel_properties", propertiesOf, py::arg("kernel"),
        py::arg("device"), py::arg("block_dim") = 0);
  m.def(
      "suggested_block",
      [](const py::object &object, int device) {
        Kernel &kernel = kernelOf(object);
        warp::python::Unlocked unlocked;
        return kernel.suggestedBlock(device);
      },
      py::arg("kernel"), py::arg("device"));
  m.def(
      "read_cached",
      [](const py::bytes &bytes) { return readCached(std::string(bytes)); },
      py::arg("bytes"), "Entry and code in a file of the kernel cache.");
  m.def("gpu_architectures", gpuArchitectures);
  m.def("host_processor", hostProcessor);
  py::class_<SavedModule>(m, "SavedModule")
      .def(py::init([](const std::string &path) {
             return std::make_unique<SavedModule>(SavedModule::load(path));
           }),
           py::arg("path"))
      .def_readonly("name", &SavedModule::name)
      .def_property_readonly("kernels", describeKernels,
                             "(name, target, number of variants) of each.")
      .def_property_readonly("codes", describeCodes,
                             "A dictionary for each variant.")
      .def("attach", attach, py::arg("kernel"), py::arg("name"),
           "Gives a kernel its saved code; False if there is none.");
}

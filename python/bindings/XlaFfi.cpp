//===- XlaFfi.cpp - Kernels as calls of XLA -------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// XLA calls out to native code through a C interface: a function gets a "call
// frame" with buffers, attributes and, on CUDA, a stream. Here is one such
// function per platform for all kernels. The attribute `call` names an entry
// of a table that Python filled while JAX traced: kernel, extents, packed
// scalar arguments, and which buffer is which array. A call fills in addresses
// and runs the kernel, without Python and without its lock.
//
// On CUDA XLA may record calls in a graph of its own. It does not tell when
// that goes, so what a recorded launch uses is kept.
//
// Buffers with leading extents beyond the expected ones come from `vmap`: the
// kernel then runs once per batch entry.
//
//===----------------------------------------------------------------------===//

#include "KernelObject.h"
#include "XlaCall.h"

#include "warp/Forks.h"
#include "warp/Graph.h"

#include <cstring>
#include <memory>
#include <unordered_map>

namespace py = pybind11;
using namespace warp;
using namespace warp::python;

/// XLA's number of an element type.
static int32_t typeNumber(Scalar scalar) {
  switch (scalar) {
  case Scalar::Bool:
    return 1;
  case Scalar::I8:
    return 2;
  case Scalar::I16:
    return 3;
  case Scalar::I32:
    return 4;
  case Scalar::I64:
    return 5;
  case Scalar::U8:
    return 6;
  case Scalar::U16:
    return 7;
  case Scalar::U32:
    return 8;
  case Scalar::U64:
    return 9;
  case Scalar::F16:
    return 10;
  case Scalar::F32:
    return 11;
  case Scalar::F64:
    return 12;
  case Scalar::BF16:
    return 16;
  }
  return 0;
}

//===----------------------------------------------------------------------===//
// The table of calls
//===----------------------------------------------------------------------===//

namespace {

/// An array parameter and the buffer it is.
struct ArrayPlan {
  std::string name;
  int64_t offset = 0;
  bool isResult = false;
  int64_t buffer = 0;
  int32_t type = 0;
  ArrayDescriptor descriptor;
  /// Extents of the buffer: those of the array, then those of an element.
  std::vector<int64_t> extents;
  int64_t bytes = 0;
};

struct CallPlan {
  Kernel *kernel = nullptr;
  /// Keeps the kernel; never released, as XLA keeps its programs.
  py::object owner;
  LaunchDim dim;
  int blockDim = 0;
  std::vector<uint64_t> block;
  std::vector<ArrayPlan> arrays;
};

struct CallTable {
  ForkMutex mutex;
  std::unordered_map<int64_t, std::unique_ptr<CallPlan>> plans;
};

} // namespace

static CallTable &calls() {
  static auto *table = new CallTable;
  return *table;
}

static ArrayPlan planArray(const Param &param, bool isResult, int64_t buffer,
                           const py::tuple &extents) {
  ArrayPlan plan;
  plan.name = param.name;
  plan.offset = param.offset;
  plan.isResult = isResult;
  plan.buffer = buffer;
  TypeShape shape = shapeOfType(param.element);
  plan.type = typeNumber(shape.scalar);
  plan.descriptor.ndim = param.rank;
  for (int i = 0; i < param.rank; ++i)
    plan.descriptor.shape[i] = extents[i].cast<int32_t>();
  plan.bytes = param.elementSize;
  for (int i = param.rank - 1; i >= 0; --i) {
    if (plan.bytes > INT32_MAX)
      throw py::value_error("expects strides below 2^31 bytes for '" +
                            param.name + "'");
    plan.descriptor.strides[i] = static_cast<int32_t>(plan.bytes);
    plan.bytes *= plan.descriptor.shape[i];
  }
  plan.extents.assign(plan.descriptor.shape,
                      plan.descriptor.shape + param.rank);
  plan.extents.insert(plan.extents.end(), shape.extents.begin(),
                      shape.extents.end());
  return plan;
}

/// `arguments` has one entry per parameter: (is result, buffer, extents) for
/// arrays, (value,) for the others. `number` makes the call's number from the
/// packed values.
static int64_t addCall(py::object kernelObject, const py::tuple &dim,
                       const py::list &arguments, int blockDim,
                       const py::function &number) {
  KernelObject &object = *asKernel(kernelObject.ptr());
  auto plan = std::make_unique<CallPlan>();
  plan->kernel = object.kernel;
  plan->owner = kernelObject;
  plan->blockDim = blockDim;
  plan->dim.rank = static_cast<int>(dim.size());
  for (int i = 0; i < plan->dim.rank; ++i)
    plan->dim.extent[i] = dim[i].cast<int64_t>();
  plan->block.resize((object.kernel->parameterSize() + 7) / 8);
  std::vector<py::object> keep;
  for (size_t i = 0; i < arguments.size(); ++i) {
    const Param &param = object.packer->param(i);
    auto entry = arguments[i].cast<py::tuple>();
    if (param.kind == Param::Kind::Array)
      plan->arrays.push_back(planArray(param, entry[0].cast<bool>(),
                                       entry[1].cast<int64_t>(),
                                       entry[2].cast<py::tuple>()));
    else
      object.packer->pack(i, entry[0].ptr(), defaultDevice,
                          reinterpret_cast<char *>(plan->block.data()), keep);
  }
  auto id = number(py::bytes(reinterpret_cast<char *>(plan->block.data()),
                             plan->block.size() * 8))
                .cast<int64_t>();
  // The entry may exist, and be in use: it is the same.
  CallTable &table = calls();
  std::lock_guard lock(table.mutex);
  table.plans.try_emplace(id, std::move(plan));
  return id;
}

//===----------------------------------------------------------------------===//
// Running a call
//===----------------------------------------------------------------------===//

static CallPlan &findPlan(const xla::Attributes &attributes) {
  int64_t id = callNumber(attributes);
  CallTable &table = calls();
  std::lock_guard lock(table.mutex);
  auto found = table.plans.find(id);
  if (found == table.plans.end())
    fail("the program was traced in another process");
  return *found->second;
}

static const xla::Buffer &findBuffer(const xla::Frame &frame,
                                     const ArrayPlan &plan) {
  const xla::Buffers &list = plan.isResult ? frame.results : frame.arguments;
  if (plan.buffer >= list.count)
    fail("expects more buffers than XLA passes");
  const xla::Buffer &buffer = *list.items[plan.buffer];
  auto expected = static_cast<int64_t>(plan.extents.size());
  int64_t batch = buffer.rank - expected;
  if (buffer.type != plan.type || batch < 0 ||
      !std::equal(plan.extents.begin(), plan.extents.end(),
                  buffer.extents + batch))
    fail("array '" + plan.name +
         "' has another type or shape than when the "
         "program was traced");
  return buffer;
}

namespace {
/// The leading extents that `vmap` adds, those of all buffers together.
class Batch {
public:
  void add(const xla::Buffer &buffer, const ArrayPlan &plan) {
    std::vector<int64_t> own(buffer.extents, buffer.extents + buffer.rank -
                                                 plan.extents.size());
    if (own.size() > extents.size())
      extents.resize(own.size(), 1);
    for (size_t i = 0; i < own.size(); ++i)
      if (own[i] != 1)
        extents[i] = own[i];
    owned.push_back(std::move(own));
  }
  int64_t size() const {
    int64_t count = 1;
    for (int64_t extent : extents)
      count *= extent;
    return count;
  }
  /// The entry of its own that a buffer has for an entry of the batch.
  int64_t entry(size_t buffer, int64_t index) const {
    int64_t position = 0, step = 1;
    for (size_t i = extents.size(); i-- > 0; index /= extents[i]) {
      if (i >= owned[buffer].size())
        continue;
      if (owned[buffer][i] != 1)
        position += index % extents[i] * step;
      step *= owned[buffer][i];
    }
    return position;
  }

private:
  std::vector<int64_t> extents;
  std::vector<std::vector<int64_t>> owned;
};
} // namespace

static void runPlan(CallPlan &plan, const xla::Frame &frame, int device,
                    const Stream *stream) {
  std::vector<uint64_t> copy = plan.block;
  auto *block = reinterpret_cast<char *>(copy.data());
  Batch batch;
  std::vector<char *> bases;
  for (const ArrayPlan &array : plan.arrays) {
    const xla::Buffer &buffer = findBuffer(frame, array);
    batch.add(buffer, array);
    bases.push_back(static_cast<char *>(buffer.data));
  }
  Kernel::Plan launch;
  int64_t count = batch.size();
  for (int64_t entry = 0; entry < count; ++entry) {
    for (size_t i = 0; i < bases.size(); ++i) {
      const ArrayPlan &array = plan.arrays[i];
      ArrayDescriptor descriptor = array.descriptor;
      descriptor.data = bases[i] + batch.entry(i, entry) * array.bytes;
      std::memcpy(block + array.offset, &descriptor, sizeof(descriptor));
    }
    if (entry == 0)
      launch = plan.kernel->prepare(device, plan.dim, block, plan.blockDim);
    if (launch.items == 0)
      return;
    plan.kernel->run(launch, block, stream);
  }
}

/// Never released, as XLA keeps its programs.
static void keepRecorded(std::shared_ptr<Graph> graph) {
  static auto *graphs = new std::vector<std::shared_ptr<Graph>>;
  std::lock_guard lock(calls().mutex);
  graphs->push_back(std::move(graph));
}

static void runCall(const xla::Frame &frame, CallPlace place) {
  CallPlan &plan = findPlan(frame.attributes);
  if (isHost(place.device))
    return runPlan(plan, frame, place.device, nullptr);
  auto stream = std::make_shared<Stream>(place.device, place.stream);
  std::unique_ptr<Capture> capture;
  if (stream->isCapturing())
    capture = Capture::begin(place.device, stream, CaptureMode::ThreadLocal,
                             /*external=*/true);
  runPlan(plan, frame, place.device, stream.get());
  if (capture)
    keepRecorded(capture->end());
}

void python::bindXlaFfi(py::module_ &m) {
  bindXlaCallback(m);
  m.def("xla_add_call", &addCall, py::arg("kernel"), py::arg("dim"),
        py::arg("arguments"), py::arg("block_dim"), py::arg("number"),
        "Makes a launch known to XLA's calls; returns its number.");
  m.def(
      "xla_handlers",
      [] {
        return py::make_tuple(handlerCapsule(handle<runCall, false>),
                              handlerCapsule(handle<runCall, true, true>));
      },
      "The functions that XLA calls: for the CPU, for CUDA.");
}

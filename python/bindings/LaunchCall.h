//===- LaunchCall.h - Parts of a launch from Python -------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Shared by launches that pack their arguments each time and by recorded ones.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_PYTHON_BINDINGS_LAUNCHCALL_H
#define WARP_PYTHON_BINDINGS_LAUNCHCALL_H

#include "Gil.h"
#include "KernelObject.h"

#include "warp/Forks.h"

#include <vector>

namespace warp::python {

/// Memory for a parameter block, on the stack where it fits.
class Block {
public:
  explicit Block(size_t size) {
    if (size > sizeof(local))
      large.resize(size / 8 + 1);
  }
  char *data() {
    return large.empty() ? local : reinterpret_cast<char *>(large.data());
  }

private:
  alignas(16) char local[1024];
  std::vector<uint64_t> large;
};

/// Items of a list or tuple, or of a copy of any other sequence.
class Items {
public:
  explicit Items(PyObject *sequence) {
    if (!sequence || sequence == Py_None)
      return;
    if (!PyList_Check(sequence) && !PyTuple_Check(sequence)) {
      copy = pybind11::reinterpret_steal<pybind11::object>(
          PySequence_List(sequence));
      if (!copy) {
        PyErr_Clear();
        throw Error(Error::Kind::LaunchType,
                    "launch: expects a list or tuple of arguments, but got " +
                        describeValue(sequence));
      }
      sequence = copy.ptr();
    }
    items = sequence;
    count = PySequence_Fast_GET_SIZE(sequence);
  }
  size_t size() const { return count; }
  /// Looked up each time: packing may call Python, which may change the list.
  PyObject *operator[](size_t i) const {
    if (static_cast<size_t>(PySequence_Fast_GET_SIZE(items)) != count)
      throw Error(Error::Kind::Launch,
                  "launch: the list of arguments changed during the launch");
    return PySequence_Fast_GET_ITEM(items, i);
  }

private:
  pybind11::object copy;
  size_t count = 0;
  PyObject *items = nullptr;
};

LaunchDim readDim(const Kernel &kernel, PyObject *value);
/// Packs all arguments of a launch; `keep` holds what was made to read them.
void packArguments(Packer &packer, const Items &inputs, const Items &outputs,
                   int device, char *block,
                   std::vector<pybind11::object> &keep);
/// The stream of a Python object; null for None.
const Stream *asStream(PyObject *object);
/// Flushes Python's output before the kernel prints.
void flushPythonOutput();

/// After a launch that waits for its code: it may print.
inline void noteQueued(const Kernel::Plan &plan) {
  if (!plan.variant || Kernel::prints(plan))
    flushPythonOutput();
}

/// Runs a plan; the GIL is released and what `makeHold` returns is kept if it
/// may take long.
template <typename MakeHold>
void runPlan(Kernel &kernel, const Kernel::Plan &plan, void *block,
             const Stream *stream, bool isShort, MakeHold &&makeHold) {
  if (Kernel::prints(plan))
    flushPythonOutput();
  if (isShort)
    return kernel.run(plan, block, stream);
  auto hold = makeHold();
  Unlocked unlocked;
  kernel.run(plan, block, stream);
}

template <typename MakeHold>
void launchPacked(Kernel &kernel, int device, const LaunchDim &dim, char *block,
                  const Stream *stream, int blockDim, MakeHold &&makeHold) {
  Kernel::Plan plan = kernel.tryPrepare(device, dim, block, blockDim);
  if (plan.items == 0)
    return;
  if (__builtin_expect(!plan.variant || Kernel::mustQueue(device), 0) &&
      kernel.queue(plan, device, dim, block, stream, blockDim))
    return noteQueued(plan);
  if (!plan.variant) {
    auto hold = makeHold();
    Unlocked unlocked;
    ForkSection section;
    plan = kernel.prepare(device, dim, block, blockDim);
  }
  runPlan(kernel, plan, block, stream, Kernel::isShort(plan), makeHold);
}

} // namespace warp::python

#endif // WARP_PYTHON_BINDINGS_LAUNCHCALL_H

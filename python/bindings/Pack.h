//===- Pack.h - Marshalling of kernel arguments -----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_PYTHON_BINDINGS_PACK_H
#define WARP_PYTHON_BINDINGS_PACK_H

#include "Native.h"

#include "warp/Kernel.h"

#include <string>
#include <vector>

namespace warp::python {

enum class Scalar {
  Bool,
  I8,
  I16,
  I32,
  I64,
  U8,
  U16,
  U32,
  U64,
  F16,
  BF16,
  F32,
  F64
};

/// The facts about a type from its text.
struct TypeShape {
  enum class Kind { Scalar, Composite, Struct, Other };
  Kind kind = Kind::Other;
  Scalar scalar = Scalar::F32;
  /// Extents of a composite: {3} for a vec3, {3, 3} for a mat33.
  std::vector<int64_t> extents;
  int64_t count = 1;
};
TypeShape shapeOfType(const std::string &text);
int64_t byteSize(Scalar scalar);

/// One parameter, prepared for packing.
struct PackParam {
  const Param *param;
  Param::Kind kind;
  int64_t offset, size;
  /// Arrays: number of the element type.
  int typeId = -1;
  TypeShape shape;
  /// The class seen last whose bytes are the argument; a strong reference.
  PyTypeObject *accepted = nullptr;
};

enum class Outcome { Ok, WrongType, OutOfRange };

/// Stores a Python number as a scalar.
Outcome storeScalar(Scalar scalar, PyObject *value, char *out);

/// "an 'array(...)' of device 'cpu'", "'None'", "'str'": for messages.
std::string describeValue(PyObject *value);
std::string expectedText(const Param &param);

/// Packs the arguments of one kernel. Objects that a foreign array needs to
/// stay valid is appended to `keep`.
class Packer {
public:
  explicit Packer(const Kernel &kernel);
  ~Packer();
  Packer(const Packer &) = delete;
  Packer &operator=(const Packer &) = delete;

  size_t size() const { return params.size(); }
  const Param &param(size_t i) const { return *params[i].param; }

  void pack(size_t index, PyObject *value, int device, char *block,
            std::vector<pybind11::object> &keep) {
    PackParam &param = params[index];
    if (param.kind == Param::Kind::Array && isArray(value)) {
      ArrayObject *array = asArray(value);
      if (array->packId == param.typeId && array->device == device &&
          array->descriptor.ndim == param.param->rank) {
        __builtin_memcpy(block + param.offset, &array->descriptor,
                         sizeof(ArrayDescriptor));
        return;
      }
    } else if (param.kind == Param::Kind::Scalar) {
      if (storeScalar(param.shape.scalar, value, block + param.offset) ==
          Outcome::Ok)
        return;
    }
    packSlowly(param, value, device, block, keep);
  }

  [[noreturn]] void raiseCount(size_t got) const;
  /// An error about one argument.
  Error error(const PackParam &param, PyObject *value,
              const std::string &more = {}) const;

private:
  void packSlowly(PackParam &param, PyObject *value, int device, char *block,
                  std::vector<pybind11::object> &keep);
  void packArray(const PackParam &param, PyObject *value, int device,
                 char *block, std::vector<pybind11::object> &keep);
  void checkStructArrays(const PackParam &param, PyObject *value,
                         const char *bytes, int device);
  void checkUse(const PackParam &param, int64_t offset) const;
  void packComposite(PackParam &param, PyObject *value, char *out);
  bool packBytes(PackParam &param, PyObject *value, char *out);
  bool packStandIn(PackParam &param, PyObject *value, char *out);

  const Kernel &owner;
  std::string kernel;
  std::vector<PackParam> params;
};

/// Reads an array of another library through its array interface; `flags` of
/// the descriptor tells whether its memory must not be written. False if the
/// object has none; throws if it has one that does not fit.
bool readForeignArray(const Packer &packer, const PackParam &param,
                      PyObject *value, int device, ArrayDescriptor &out,
                      std::vector<pybind11::object> &keep);

} // namespace warp::python

#endif // WARP_PYTHON_BINDINGS_PACK_H

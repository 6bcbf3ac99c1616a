//===- Array.h - Arrays and launches for C++ programs -----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Arrays for a C++ program that runs a kernel of a `SavedModule` on its own
// data: `view` makes a kernel argument of memory that the program has, `Array`
// owns memory of a device, `launch` checks the arguments against the kernel's
// parameters, packs them and runs it.
//
//   std::vector<float> x(n), y(n);
//   warp::launch(saxpy, warp::cpuDevice, {n}, warp::view(x.data(), {n}),
//                warp::view(y.data(), {n}), 2.0f);
//
//   warp::Array<float> x(0, {n});        // on cuda:0
//   x.copyFrom(values.data());
//
// Scalars have to be of the parameter's type. Vectors, matrices and structs are
// any type of the right size; so are elements of arrays.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_ARRAY_H
#define WARP_ARRAY_H

#include "warp/Kernel.h"
#include "warp/Launch.h"
#include "warp/Memory.h"

#include <cstring>
#include <initializer_list>
#include <string>
#include <type_traits>
#include <vector>

namespace warp {

/// Memory of someone else with a shape; strides are in elements, and packed if
/// left out.
template <typename T> struct ArrayArgument {
  ArrayDescriptor descriptor;
};

/// `gradient` is memory of the same shape and strides, in elements.
template <typename T>
ArrayArgument<T> view(T *data, std::initializer_list<int64_t> shape,
                      std::initializer_list<int64_t> strides = {},
                      std::remove_const_t<T> *gradient = nullptr) {
  if (shape.size() < 1 || shape.size() > maxRank ||
      (strides.size() && strides.size() != shape.size()))
    throw Error(Error::Kind::Value,
                "an array has 1 to 4 dimensions and a stride for each");
  ArrayArgument<T> result;
  ArrayDescriptor &array = result.descriptor;
  array.data = const_cast<std::remove_const_t<T> *>(data);
  array.grad = gradient;
  array.ndim = static_cast<int32_t>(shape.size());
  int64_t packed = sizeof(T);
  for (int i = array.ndim - 1; i >= 0; --i) {
    int64_t stride =
        strides.size() ? strides.begin()[i] * int64_t(sizeof(T)) : packed;
    int64_t extent = shape.begin()[i];
    if (extent < 0 || extent > INT32_MAX || stride != int32_t(stride))
      throw Error(Error::Kind::Value,
                  "extents and strides of an array are below 2^31");
    array.shape[i] = static_cast<int32_t>(extent);
    array.strides[i] = static_cast<int32_t>(stride);
    packed *= extent;
  }
  array.flags = arrayFacts(array, sizeof(T));
  return result;
}

/// A packed array in the memory of a device.
template <typename T> class Array {
public:
  Array(int device, std::initializer_list<int64_t> shape)
      : Array(device, warp::view(static_cast<T *>(nullptr), shape)) {}

  T *data() const { return static_cast<T *>(buffer.data()); }
  int device() const { return buffer.device(); }
  size_t size() const { return buffer.size() / sizeof(T); }
  /// Copy all elements from and to memory of the host, or of another device.
  void copyFrom(const T *source, int from = cpuDevice) {
    copyMemory(buffer.data(), device(), source, from, buffer.size());
  }
  void copyTo(T *target, int to = cpuDevice) const {
    copyMemory(target, to, buffer.data(), device(), buffer.size());
  }
  operator ArrayArgument<T>() const { return argument; }

private:
  Array(int device, ArrayArgument<T> shaped)
      : argument(shaped), buffer(device, bytesOf(shaped.descriptor)) {
    argument.descriptor.data = buffer.data();
    argument.descriptor.flags = arrayFacts(argument.descriptor, sizeof(T));
  }
  static size_t bytesOf(const ArrayDescriptor &array) {
    size_t bytes = sizeof(T);
    for (int i = 0; i < array.ndim; ++i)
      bytes *= array.shape[i];
    return bytes;
  }

  ArrayArgument<T> argument;
  Buffer buffer;
};

namespace detail {

/// The compiler's name of a scalar type; empty for others.
template <typename T> std::string scalarName() {
  if (std::is_same_v<T, bool>)
    return "i1";
  if (std::is_floating_point_v<T>)
    return "f" + std::to_string(8 * sizeof(T));
  if (std::is_integral_v<T>)
    return (std::is_signed_v<T> ? "si" : "ui") + std::to_string(8 * sizeof(T));
  return "";
}

[[noreturn]] inline void reject(const Kernel &kernel, const Param &param,
                                const std::string &got) {
  throw Error(Error::Kind::LaunchType,
              "launch('" + kernel.name() + "'): argument '" + param.name +
                  "' expects " + param.type + ", but got " + got);
}

inline bool isScalarName(const std::string &text) {
  return !text.empty() && text[0] != '!';
}

/// The mismatch of a value of C++ type `T` and the compiler's type.
template <typename T>
std::string mismatch(const std::string &type, int64_t size) {
  std::string name = scalarName<T>();
  if (isScalarName(type) && !name.empty() && name != type)
    return name;
  if (int64_t(sizeof(T)) != size)
    return std::to_string(sizeof(T)) + " bytes instead of " +
           std::to_string(size);
  return "";
}

template <typename T>
void packArgument(const Kernel &kernel, const Param &param, char *block,
                  const T &value) {
  static_assert(std::is_trivially_copyable_v<T>,
                "kernel arguments are plain data");
  if (param.kind == Param::Kind::Array)
    reject(kernel, param, "a value that is no array");
  std::string problem = mismatch<T>(param.type, param.size);
  if (!problem.empty())
    reject(kernel, param, problem);
  std::memcpy(block + param.offset, &value, sizeof(T));
}

template <typename T>
void packArgument(const Kernel &kernel, const Param &param, char *block,
                  const ArrayArgument<T> &value) {
  if (param.kind != Param::Kind::Array)
    reject(kernel, param, "an array");
  using Element = std::remove_const_t<T>;
  std::string problem = mismatch<Element>(param.element, param.elementSize);
  if (!problem.empty())
    reject(kernel, param, "an array with elements of " + problem);
  if (value.descriptor.ndim != param.rank)
    reject(kernel, param,
           "an array of " + std::to_string(value.descriptor.ndim) +
               " dimensions");
  std::memcpy(block + param.offset, &value.descriptor,
              sizeof(value.descriptor));
}

template <typename T>
void packArgument(const Kernel &kernel, const Param &param, char *block,
                  const Array<T> &value) {
  packArgument(kernel, param, block, ArrayArgument<T>(value));
}

} // namespace detail

/// Runs a kernel once per index of a grid of up to 4 extents. On CUDA it is
/// queued on the device's current stream; copies and `synchronizeDevice` wait.
template <typename... Arguments>
void launch(Kernel &kernel, int device, std::initializer_list<int64_t> extents,
            const Arguments &...arguments) {
  const std::vector<Param> &params = kernel.parameters();
  if (params.size() != sizeof...(Arguments))
    throw Error(Error::Kind::LaunchType,
                "launch('" + kernel.name() + "'): expects " +
                    std::to_string(params.size()) + " arguments, but got " +
                    std::to_string(sizeof...(Arguments)));
  LaunchDim dim;
  dim.rank = static_cast<int>(extents.size());
  int axis = 0;
  for (int64_t extent : extents)
    if (axis < maxRank)
      dim.extent[axis++] = extent;
  std::vector<uint64_t> block(kernel.parameterSize() / 8);
  auto *bytes = reinterpret_cast<char *>(block.data());
  size_t next = 0;
  (detail::packArgument(kernel, params[next++], bytes, arguments), ...);
  (void)next;
  kernel.launch(device, dim, bytes);
}

} // namespace warp

#endif // WARP_ARRAY_H

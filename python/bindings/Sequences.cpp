//===- Sequences.cpp - Scans, sorts and runs for Python -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// And products of sparse matrices. Shapes, types and devices have been checked
// in Python (warp/_src/utils/sequences.py, warp/_src/sparse).
//
//===----------------------------------------------------------------------===//

#include "Native.h"

#include "warp/SparseProduct.h"

namespace py = pybind11;
using namespace warp;
using namespace warp::python;

namespace {
/// An array as an argument: what a capture keeps, and its memory.
struct Argument {
  explicit Argument(const py::object &object) : array(asArray(object.ptr())) {
    if (!isArray(object.ptr()))
      throw Error(Error::Kind::LaunchType, "expects an array");
    hold(array->device, object.ptr());
  }

  int device() const { return array->device; }
  void *data() const { return array->descriptor.data; }
  int64_t count() const {
    int64_t product = 1;
    for (int i = 0; i < array->descriptor.ndim; ++i)
      product *= array->descriptor.shape[i];
    return product;
  }
  template <typename T> T *as() const { return static_cast<T *>(data()); }
  /// Elements in a row, whatever the rank of a contiguous array.
  Sequence sequence() const {
    bool packed = array->isContiguous() || array->descriptor.ndim != 1;
    return {data(), packed ? array->itemSize : array->descriptor.strides[0]};
  }

  ArrayObject *array;
};
} // namespace

static NumberType numberOf(const std::string &kind) {
  for (auto [name, number] : {std::pair{"int32", NumberType::Int32},
                              {"uint32", NumberType::UInt32},
                              {"float32", NumberType::Float32},
                              {"int64", NumberType::Int64},
                              {"uint64", NumberType::UInt64},
                              {"float64", NumberType::Float64}})
    if (kind == name)
      return number;
  throw Error(Error::Kind::LaunchType, "no numbers of type '" + kind + "'");
}

static void scan(const py::object &in, const py::object &out,
                 const std::string &kind, int width, int64_t count,
                 bool inclusive) {
  Argument from(in), to(out);
  py::gil_scoped_release unlocked;
  scanNumbers(to.device(), numberOf(kind), width, to.sequence(),
              from.sequence(), count, inclusive);
}

static Pairs pairsOf(const Argument &keys, const Argument &values,
                     const std::string &kind, int64_t count) {
  return {numberOf(kind), keys.data(), values.data(),
          static_cast<int>(values.array->itemSize), count};
}

static void sort(const py::object &keys, const py::object &values,
                 const std::string &kind, int64_t count, int beginBit,
                 int endBit) {
  Argument first(keys), second(values);
  py::gil_scoped_release unlocked;
  sortPairs(first.device(), pairsOf(first, second, kind, count), beginBit,
            endBit);
}

static bool sortAnywhere(const py::object &keys, const py::object &values,
                         const std::string &kind, int64_t count, int beginBit,
                         int endBit) {
  Argument first(keys), second(values);
  py::gil_scoped_release unlocked;
  return sortPairsAnywhere(first.device(), pairsOf(first, second, kind, count),
                           beginBit, endBit);
}

static void sortEach(const py::object &keys, const py::object &values,
                     const std::string &kind, int64_t count,
                     const py::object &begins, const py::object &ends,
                     int64_t segments) {
  Argument first(keys), second(values), from(begins), to(ends);
  py::gil_scoped_release unlocked;
  sortSegments(first.device(), pairsOf(first, second, kind, count),
               from.as<int32_t>(), to.as<int32_t>(), segments);
}

static void encode(const py::object &numbers, int64_t count,
                   const py::object &runNumbers, const py::object &runLengths,
                   const py::object &runCount) {
  Argument all(numbers), starts(runNumbers), lengths(runLengths),
      total(runCount);
  py::gil_scoped_release unlocked;
  findRuns(all.device(),
           {static_cast<int>(all.array->itemSize), all.data(), count,
            starts.data(), lengths.as<int32_t>(), total.as<int32_t>()});
}

static void multiply(const std::string &kind, const py::object &offsets,
                     const py::object &columns, const py::object &values,
                     const py::object &x, const py::object &y, double alpha,
                     double beta) {
  Argument starts(offsets), places(columns), numbers(values), from(x), to(y);
  py::gil_scoped_release unlocked;
  multiplyRows(to.device(),
               {numberOf(kind), to.count(), from.count(), starts.as<int32_t>(),
                places.as<int32_t>(), numbers.data(), places.count(),
                from.data(), to.data(), alpha, beta});
}

void python::bindSequences(py::module_ &m) {
  m.def("scan_numbers", &scan, py::arg("source"), py::arg("target"),
        py::arg("kind"), py::arg("width"), py::arg("count"),
        py::arg("inclusive"));
  m.def("sort_pairs_anywhere", &sortAnywhere, py::arg("keys"),
        py::arg("values"), py::arg("kind"), py::arg("count"),
        py::arg("begin_bit"), py::arg("end_bit"),
        "Sorts pairs; tells whether they are in the room behind.");
  m.def("sort_pairs", &sort, py::arg("keys"), py::arg("values"),
        py::arg("kind"), py::arg("count"), py::arg("begin_bit"),
        py::arg("end_bit"));
  m.def("sort_segments", &sortEach, py::arg("keys"), py::arg("values"),
        py::arg("kind"), py::arg("count"), py::arg("begins"), py::arg("ends"),
        py::arg("segments"));
  m.def("find_runs", &encode, py::arg("numbers"), py::arg("count"),
        py::arg("run_numbers"), py::arg("run_lengths"), py::arg("run_count"));
  m.def("multiply_rows", &multiply, py::arg("kind"), py::arg("offsets"),
        py::arg("columns"), py::arg("values"), py::arg("x"), py::arg("y"),
        py::arg("alpha"), py::arg("beta"));
}

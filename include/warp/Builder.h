//===- Builder.h - Kernel builder without MLIR types ------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The front end's door into the compiler. A `Builder` holds one module: the
// functions of one kernel, built in order of use, callees first. The caller
// walks its own syntax tree and calls the methods below; every type rule
// (overloads, result types, agreement over branches) is applied here, from
// the registry of builtins.
//
// Values are SSA values. Variables, and what is carried around a loop, are
// the caller's business: a loop gets its initial values when it begins, and
// the values yielded by the body when it ends. A variable first assigned
// inside a body is passed as `late`: it leaves the loop as an extra result
// that is zero when no iteration ran.
//
// Types and values are handles, cheap to copy and valid as long as the module
// they belong to. Every error is a `warp::Error` that carries the place set
// with `setLocation`. All of it may be called from any thread, one thread per
// builder.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_BUILDER_H
#define WARP_BUILDER_H

#include "warp/Error.h"
#include "warp/Export.h"

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

namespace warp {

/// A compile-time number. Unsigned 64-bit numbers above INT64_MAX come as
/// `uint64_t`, everything else that is integral as `int64_t`.
using Number = std::variant<bool, int64_t, uint64_t, double>;

/// A type of the warp dialect.
struct WARP_API Type {
  enum class Kind {
    Bool,
    Int,
    Float,
    Vector,
    Matrix,
    Quaternion,
    Transform,
    Array,
    Struct,
    Tile,
    Other,
  };
  struct Field;

  const void *impl = nullptr;

  /// Parses the textual form, "f32" or "!warp.vec<3 x f32>".
  static Type parse(std::string_view text);
  std::string str() const;
  /// The name that a Python user knows: "vec3f", "array(dtype=float32)".
  std::string pythonName() const;

  Kind kind() const;
  /// Bits of a scalar; 0 for everything else.
  int width() const;
  bool isSigned() const;
  /// Scalar type of a composite, element type of an array or tile, null
  /// otherwise.
  Type element() const;
  /// Extents of a vector, matrix or tile; empty for everything else.
  std::vector<int64_t> shape() const;
  /// Dimensions of an array; 0 for everything else.
  int rank() const;
  std::string structName() const;
  std::vector<Field> fields() const;
  int64_t byteSize() const;
  int64_t byteAlign() const;

  explicit operator bool() const { return impl != nullptr; }
  bool operator==(const Type &other) const { return impl == other.impl; }
  bool operator!=(const Type &other) const { return impl != other.impl; }
};

struct Type::Field {
  std::string name;
  Type type;
};

/// An SSA value of the module under construction.
struct WARP_API Value {
  void *impl = nullptr;

  Type type() const;
  /// The number, if the value is a scalar constant.
  std::optional<Number> constant() const;

  explicit operator bool() const { return impl != nullptr; }
  bool operator==(const Value &other) const { return impl == other.impl; }
};

/// A verified module: one kernel and the functions it calls.
class WARP_API Module {
public:
  struct Impl;

  /// Parses and verifies the textual form; malformed text is an error of
  /// kind `Parse` that names line and column of the text.
  static Module fromText(std::string_view text);
  /// The textual form, with source locations if `locations`.
  std::string text(bool locations = false) const;
  /// Name of the kernel function; empty when there is none.
  std::string kernelName() const;

  explicit Module(std::shared_ptr<Impl> impl) : impl(std::move(impl)) {}
  const std::shared_ptr<Impl> &getImpl() const { return impl; }

private:
  std::shared_ptr<Impl> impl;
};

class WARP_API Builder {
public:
  using Values = std::vector<Value>;

  /// Results of a builtin. `inout` holds the new value of each argument that
  /// the builtin updates, by argument position.
  struct Results {
    Values values;
    std::vector<std::pair<int, Value>> inout;
  };

  explicit Builder(const std::string &name);
  ~Builder();
  Builder(const Builder &) = delete;
  Builder &operator=(const Builder &) = delete;

  /// Place in the user's source of whatever is built next. Line and column
  /// count from 1.
  void setLocation(const std::string &file, int line, int column);

  /// Opens a function and returns its arguments. Result types follow from
  /// `endFunction`.
  Values beginFunction(const std::string &name,
                       const std::vector<std::string> &argNames,
                       const std::vector<Type> &argTypes, bool isKernel);
  void endFunction(const Values &results);
  /// Scalar operations of the open kernel beyond which large functions with
  /// several calls stay functions.
  void setInlineBudget(int64_t operations);
  /// Result types of a finished function.
  std::vector<Type> resultTypes(const std::string &name) const;

  /// A scalar constant, or a composite with every component set to `number`.
  /// A number that does not fit is an error of kind `Overflow`.
  Value constant(Type type, Number number);
  Value zero(Type type);
  Values call(const std::string &name, const Values &args);
  /// Says which function is the derivative of another, whose last `residuals`
  /// results are for it alone; BuilderDerivatives.cpp
  /// has the signatures.
  void setPullback(const std::string &name, const std::string &pullback,
                   int residuals);
  /// Says which function gives the tangents of another, which has a pullback.
  void setPushforward(const std::string &name, const std::string &pushforward);
  /// Says what is called instead of a function to get its values again.
  void setReplay(const std::string &name, const std::string &replay);
  /// Cotangents of a function's arguments of floats from those of its results
  /// of floats. `arrays`: gradients of array arguments are added to.
  Values vjp(const std::string &name, const Values &args,
             const Values &cotangents, bool arrays);
  /// Tangents of a function's results of floats from those of its first
  /// arguments of floats; the others are constants.
  Values jvp(const std::string &name, const Values &args,
             const Values &tangents);
  /// Calls the builtin of that Python name (operators: "add", "lt", ...). The
  /// error for arguments that fit no overload lists the overloads.
  Results builtin(const std::string &name, const Values &args);
  /// True if the registry knows a builtin of that Python name.
  static bool hasBuiltin(const std::string &name);
  /// Builds a composite from components, a smaller composite plus rest, one
  /// scalar for all, or nothing (zero).
  Value construct(Type type, const Values &args);
  /// Converts a scalar or a composite component by component.
  Value cast(Value value, Type type);
  /// The same bits as another type of the same size.
  Value bitcast(Value value, Type type);
  Values tid(int dimensions);
  /// Positions of the arguments that some overload of a builtin updates.
  static std::vector<unsigned> inoutArguments(const std::string &name);
  /// Names of a builtin's parameters, one list per overload.
  static std::vector<std::vector<std::string>>
  parameterNames(const std::string &name);
  void printf(const std::string &format, const Values &args);
  /// Checked in debug mode only.
  void assertion(Value condition, const std::string &message);
  /// Checked in any mode: the launch fails with the message.
  void require(Value condition, const std::string &message);

  Value structCreate(Type type, const Values &fields);
  Value structGet(Value value, const std::string &field);
  Value structSet(Value value, const std::string &field, Value part);

  /// Component of a vector, matrix, quaternion or transform; a matrix with
  /// one index gives a row. Indices are constant or dynamic.
  Value extract(Value composite, const Values &indices);
  /// Type of what `extract` gives.
  Type partType(Type composite, const Values &indices);
  /// The place of an index of an array of the thread, from the end if it is
  /// below zero; debug launches check it.
  Value position(Value index, int64_t extent);
  /// An element of a constant table, of which these are the bytes in row-major
  /// order; a boolean takes one.
  Value tableGet(Type element, const std::vector<int64_t> &shape,
                 const std::string &bytes, const Values &indices);
  Value insert(Value composite, const Values &indices, Value part);

  Value load(Value array, const Values &indices);
  void store(Value array, const Values &indices, Value value);
  /// Atomic read-modify-write; returns the old element. `kind` is one of
  /// add, sub, min, max, and, or, xor, exch.
  Value atomic(const std::string &kind, Value array, const Values &indices,
               Value value);
  /// Writes `value` where the element equals `expected`; returns the old one.
  Value atomicCas(Value array, const Values &indices, Value expected,
                  Value value);
  /// The array that remains when leading dimensions are indexed.
  Value view(Value array, const Values &indices);
  /// A field, component or row of each element, as an array of that type.
  Value componentView(Value array, const std::string &field);
  Value componentView(Value array, const Values &indices);
  /// Restricts dimension `dimension` to start, stop, step (null = default).
  Value slice(Value array, int dimension, Value start, Value stop, Value step);
  /// The array without a dimension, at an index of it.
  Value indexDim(Value array, int dimension, Value index);
  /// The array of an array's gradients.
  Value grad(Value array);
  /// Extent of a dimension as an `si32`.
  Value dim(Value array, int dimension);
  /// Bytes between neighbours along a dimension, as an `si32`.
  Value stride(Value array, int dimension);
  /// Address of the first element, as a `ui64`.
  Value pointer(Value array);
  /// A packed array of this type at an address; its gradients, or null, are at
  /// another one.
  Value arrayAt(Type type, Value address, const Values &extents, Value grad);

  void beginIf(Value condition);
  void beginElse();
  /// Closes the branches; both must give the same number and types.
  Values endIf(const Values &thenValues, const Values &elseValues);

  /// Number of open loops of the current function.
  int loopDepth() const;
  /// Adds a carried value to an open loop, counted from the outermost, whose
  /// body is being built. Returns it as the body sees it; the value at the
  /// end of the body follows the others in `endFor` or `endWhile`.
  Value carry(int loop, Value init);
  /// How often a `range` of these bounds repeats, as an unsigned integer of
  /// the same width.
  Value tripCount(Value lo, Value hi, Value step);

  /// Counts from `lo` up or down to `hi` (exclusive) like Python's `range`.
  /// Returns the counter followed by the carried values.
  Values beginFor(Value lo, Value hi, Value step, const Values &inits);
  Values endFor(const Values &yields, const Values &late = {});

  /// Returns the carried values as the condition sees them.
  Values beginWhile(const Values &inits);
  /// `forwarded` are the carried values after the condition was evaluated;
  /// returns them as the body sees them.
  Values whileCondition(Value condition, const Values &forwarded);
  Values endWhile(const Values &yields, const Values &late = {});

  /// Verifies what was built. The builder is empty afterwards.
  Module finish();

  struct Impl;

private:
  friend class TileBuilder;
  std::unique_ptr<Impl> impl;
};

} // namespace warp

#endif // WARP_BUILDER_H

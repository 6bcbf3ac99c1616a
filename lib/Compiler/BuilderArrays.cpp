//===- BuilderArrays.cpp - Array accesses and views -----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "BuilderImpl.h"

using namespace mlir;

/// The array type of a value, its indices checked to be integers.
static warp::ArrayType arrayType(warp::Builder::Impl &impl, mlir::Value array,
                                 ValueRange indices, StringRef what) {
  using namespace warp;
  auto type = dyn_cast<ArrayType>(array.getType());
  if (!type)
    impl.failType(what.str() + " expects an array, but got " +
                  quoted(array.getType()));
  for (mlir::Value index : indices)
    if (!isInteger(index.getType()))
      impl.failType("array index must be an integer, but got " +
                    quoted(index.getType()) + "\nhint: use `int(...)`");
  return type;
}

/// Element type of a full access.
static mlir::Type elementType(warp::Builder::Impl &impl, mlir::Value array,
                              ValueRange indices, StringRef what) {
  using namespace warp;
  ArrayType type = arrayType(impl, array, indices, what);
  if (static_cast<int64_t>(indices.size()) != type.getRank())
    impl.fail(Error::Kind::Index,
              "expects " + std::to_string(type.getRank()) +
                  (type.getRank() == 1 ? " index" : " indices") + " for " +
                  quoted(type) + ", but got " + std::to_string(indices.size()));
  return type.getElementType();
}

/// Checks a value that goes into an element.
static void checkElement(warp::Builder::Impl &impl, mlir::Type element,
                         mlir::Value value, StringRef what) {
  using namespace warp;
  mlir::Type given = value.getType();
  if (given == element)
    return;
  std::string hint;
  if (isScalar(element) && isScalar(given))
    hint = "\nhint: use `" +
           std::string(element.isF32() ? "float"
                       : element.isSignedInteger(32)
                           ? "int"
                           : "wp." + getPythonName(element)) +
           "(...)`";
  impl.failType(what.str() + " expects " + quoted(element) +
                " for an element of the array, but got " + quoted(given) +
                hint);
}

warp::Value warp::Builder::load(Value array, const Values &indices) {
  ContextLock lock;
  SmallVector<mlir::Value> at = unwrap(indices);
  mlir::Type element = elementType(*impl, unwrap(array), at, "load");
  return wrap(
      LoadOp::create(impl->builder, impl->loc, element, unwrap(array), at)
          .getResult());
}

void warp::Builder::store(Value array, const Values &indices, Value value) {
  ContextLock lock;
  SmallVector<mlir::Value> at = unwrap(indices);
  mlir::Type element = elementType(*impl, unwrap(array), at, "store");
  checkElement(*impl, element, unwrap(value), "store");
  StoreOp::create(impl->builder, impl->loc, unwrap(value), unwrap(array), at);
}

warp::Value warp::Builder::atomic(const std::string &kind, Value array,
                                  const Values &indices, Value value) {
  ContextLock lock;
  SmallVector<mlir::Value> at = unwrap(indices);
  std::string what = "atomic_" + kind;
  std::optional<AtomicKind> parsed = symbolizeAtomicKind(kind);
  if (!parsed)
    impl->fail(Error::Kind::Key, "no builtin '" + what + "'");
  mlir::Type element = elementType(*impl, unwrap(array), at, what);
  checkElement(*impl, element, unwrap(value), what);
  mlir::Type scalar = getElementScalar(element);
  bool bitwise = llvm::is_contained({"and", "or", "xor"}, kind);
  if (!scalar || isBool(scalar) || (bitwise && !isInteger(scalar)))
    impl->failType(what + " expects an array of " +
                   (bitwise ? "integers" : "numbers") + ", but got " +
                   quoted(unwrap(array).getType()));
  return wrap(AtomicOp::create(impl->builder, impl->loc, element, *parsed,
                               unwrap(value), unwrap(array), at)
                  .getResult());
}

warp::Value warp::Builder::atomicCas(Value array, const Values &indices,
                                     Value expected, Value value) {
  ContextLock lock;
  SmallVector<mlir::Value> at = unwrap(indices);
  mlir::Type element = elementType(*impl, unwrap(array), at, "atomic_cas");
  checkElement(*impl, element, unwrap(expected), "atomic_cas");
  checkElement(*impl, element, unwrap(value), "atomic_cas");
  if (!isScalar(element))
    impl->failType("atomic_cas expects an array of numbers, but got " +
                   quoted(unwrap(array).getType()));
  return wrap(AtomicCasOp::create(impl->builder, impl->loc, element,
                                  unwrap(expected), unwrap(value),
                                  unwrap(array), at)
                  .getResult());
}

warp::Value warp::Builder::view(Value array, const Values &indices) {
  ContextLock lock;
  SmallVector<mlir::Value> at = unwrap(indices);
  ArrayType type = arrayType(*impl, unwrap(array), at, "view");
  int64_t rank = type.getRank() - static_cast<int64_t>(at.size());
  if (rank < 1)
    impl->fail(Error::Kind::Index,
               "expects fewer than " + std::to_string(type.getRank()) +
                   " indices for a view of " + quoted(type));
  auto result = ArrayType::get(type.getContext(), rank, type.getElementType());
  return wrap(
      ViewOp::create(impl->builder, impl->loc, result, unwrap(array), at)
          .getResult());
}

warp::Value warp::Builder::componentView(Value array,
                                         const std::string &field) {
  ContextLock lock;
  ArrayType type = arrayType(*impl, unwrap(array), {}, "component view");
  mlir::Type part = getFieldType(type.getElementType(), field);
  if (!part)
    impl->fail(Error::Kind::Attribute, "elements of " + quoted(type) +
                                           " have no field '" + field + "'");
  auto result = ArrayType::get(type.getContext(), type.getRank(), part);
  return wrap(ComponentViewOp::create(impl->builder, impl->loc, result,
                                      unwrap(array), ValueRange(),
                                      impl->builder.getStringAttr(field))
                  .getResult());
}

warp::Value warp::Builder::componentView(Value array, const Values &indices) {
  ContextLock lock;
  SmallVector<mlir::Value> at = unwrap(indices);
  ArrayType type = arrayType(*impl, unwrap(array), at, "component view");
  mlir::Type part = checkedPart(*impl, type.getElementType(), at);
  auto result = ArrayType::get(type.getContext(), type.getRank(), part);
  return wrap(ComponentViewOp::create(impl->builder, impl->loc, result,
                                      unwrap(array), at, StringAttr())
                  .getResult());
}

warp::Value warp::Builder::slice(Value array, int dimension, Value start,
                                 Value stop, Value step) {
  ContextLock lock;
  auto given = [&](Value bound, int64_t otherwise) {
    return bound ? unwrap(bound) : impl->constantI32(otherwise);
  };
  SmallVector<mlir::Value> bounds{given(start, 0), given(stop, INT32_MAX),
                                  given(step, 1)};
  ArrayType type = arrayType(*impl, unwrap(array), bounds, "slice");
  if (dimension < 0 || dimension >= type.getRank())
    impl->fail(Error::Kind::Index, "no dimension " + std::to_string(dimension) +
                                       " in " + quoted(type));
  return wrap(SliceOp::create(impl->builder, impl->loc, type, unwrap(array),
                              dimension, bounds[0], bounds[1], bounds[2])
                  .getResult());
}

warp::Value warp::Builder::indexDim(Value array, int dimension, Value index) {
  ContextLock lock;
  ArrayType type = arrayType(*impl, unwrap(array), unwrap(index), "index");
  if (dimension < 0 || dimension >= type.getRank() || type.getRank() < 2)
    impl->fail(Error::Kind::Index, "no dimension " + std::to_string(dimension) +
                                       " to leave out of " + quoted(type));
  auto result = ArrayType::get(type.getContext(), type.getRank() - 1,
                               type.getElementType());
  return wrap(IndexDimOp::create(impl->builder, impl->loc, result,
                                 unwrap(array), dimension, unwrap(index))
                  .getResult());
}

warp::Value warp::Builder::dim(Value array, int dimension) {
  ContextLock lock;
  ArrayType type = arrayType(*impl, unwrap(array), {}, "shape");
  if (dimension < 0 || dimension >= type.getRank())
    impl->fail(Error::Kind::Index, "no dimension " + std::to_string(dimension) +
                                       " in " + quoted(type));
  mlir::Type result = impl->builder.getIntegerType(32, /*isSigned=*/true);
  return wrap(
      DimOp::create(impl->builder, impl->loc, result, unwrap(array), dimension)
          .getResult());
}

warp::Value warp::Builder::stride(Value array, int dimension) {
  ContextLock lock;
  ArrayType type = arrayType(*impl, unwrap(array), {}, "strides");
  if (dimension < 0 || dimension >= type.getRank())
    impl->fail(Error::Kind::Index, "no dimension " + std::to_string(dimension) +
                                       " in " + quoted(type));
  mlir::Type result = impl->builder.getIntegerType(32, /*isSigned=*/true);
  return wrap(StrideOp::create(impl->builder, impl->loc, result, unwrap(array),
                               dimension)
                  .getResult());
}

warp::Value warp::Builder::pointer(Value array) {
  ContextLock lock;
  arrayType(*impl, unwrap(array), {}, "ptr");
  mlir::Type result = impl->builder.getIntegerType(64, /*isSigned=*/false);
  return wrap(PointerOp::create(impl->builder, impl->loc, result, unwrap(array))
                  .getResult());
}

warp::Value warp::Builder::arrayAt(Type type, Value address,
                                   const Values &extents, Value grad) {
  ContextLock lock;
  SmallVector<mlir::Value> shape = unwrap(extents);
  auto wanted = dyn_cast<ArrayType>(unwrap(type));
  if (!wanted || wanted.getRank() != static_cast<int64_t>(shape.size()))
    impl->failType("expects an extent for each dimension of " +
                   quoted(unwrap(type)));
  mlir::Value gradients = unwrap(grad);
  SmallVector<mlir::Value> numbers = shape;
  numbers.push_back(unwrap(address));
  if (gradients)
    numbers.push_back(gradients);
  for (mlir::Value number : numbers)
    if (!isInteger(number.getType()))
      impl->failType("expects integers as addresses and extents, but got " +
                     quoted(number.getType()));
  mlir::Type scalar = getElementScalar(wanted.getElementType());
  if (gradients && !(scalar && isFloat(scalar)))
    impl->failType("elements of " + quoted(wanted) + " have no gradients");
  return wrap(ArrayAtOp::create(impl->builder, impl->loc, wanted,
                                unwrap(address), shape, gradients)
                  .getResult());
}

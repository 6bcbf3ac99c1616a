//===- BuilderValues.cpp - Builtins, conversions, composites, structs -----===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "BuilderImpl.h"
#include "BuilderLibrary.h"

#include "mlir/IR/Matchers.h"

using namespace mlir;

//===----------------------------------------------------------------------===//
// Builtins
//===----------------------------------------------------------------------===//

SmallVector<mlir::Value, 2> warp::Builder::Impl::fold(Operation *op) {
  auto unfolded = [&] { return SmallVector<mlir::Value, 2>(op->getResults()); };
  SmallVector<Attribute> operands;
  for (mlir::Value operand : op->getOperands()) {
    auto constant = operand.getDefiningOp<ConstantOp>();
    if (!constant)
      return unfolded();
    operands.push_back(constant.getValue());
  }
  SmallVector<OpFoldResult> folded;
  if (operands.empty() || failed(op->fold(operands, folded)) ||
      folded.size() != op->getNumResults())
    return unfolded();
  SmallVector<mlir::Value, 2> results;
  for (auto [result, type] : llvm::zip_equal(folded, op->getResultTypes())) {
    if (auto value = dyn_cast<mlir::Value>(result)) {
      results.push_back(value);
      continue;
    }
    auto attribute = dyn_cast<TypedAttr>(cast<Attribute>(result));
    if (!attribute || attribute.getType() != type)
      return unfolded();
    results.push_back(constant(attribute));
  }
  op->erase();
  return results;
}

/// The type in which two different numbers can be compared: a float if one
/// is, else a wide enough integer.
static mlir::Type comparisonType(mlir::Type a, mlir::Type b) {
  MLIRContext *context = a.getContext();
  if (warp::isFloat(a) || warp::isFloat(b)) {
    if (!warp::isFloat(a) || !warp::isFloat(b))
      return warp::isFloat(a) ? a : b;
    unsigned left = a.getIntOrFloatBitWidth();
    unsigned right = b.getIntOrFloatBitWidth();
    if (left == right)
      return Float32Type::get(context);
    return left > right ? a : b;
  }
  unsigned width =
      std::max(a.getIntOrFloatBitWidth(), b.getIntOrFloatBitWidth());
  auto needs = [&](mlir::Type type) {
    return type.isUnsignedInteger() ? type.getIntOrFloatBitWidth() * 2
                                    : type.getIntOrFloatBitWidth();
  };
  if (a.isUnsignedInteger() && b.isUnsignedInteger())
    return IntegerType::get(context, width, IntegerType::Unsigned);
  width = std::clamp(std::max(needs(a), needs(b)), 8u, 64u);
  return IntegerType::get(context, width, IntegerType::Signed);
}

static bool isComparison(StringRef name) {
  return llvm::is_contained({"eq", "ne", "lt", "le", "gt", "ge"}, name);
}

bool warp::Builder::hasBuiltin(const std::string &name) {
  return lookupBuiltin(name) != nullptr;
}

/// "name: type" of each parameter of an overload.
static SmallVector<StringRef> parametersOf(StringRef overload) {
  SmallVector<StringRef> parameters;
  StringRef list = overload.split("->").first.trim();
  list.consume_front("(");
  list.consume_back(")");
  int depth = 0;
  size_t start = 0;
  for (size_t i = 0; i <= list.size(); ++i) {
    char c = i < list.size() ? list[i] : ',';
    depth += c == '<' ? 1 : c == '>' ? -1 : 0;
    if (c != ',' || depth != 0)
      continue;
    if (StringRef one = list.slice(start, i).trim(); !one.empty())
      parameters.push_back(one);
    start = i + 1;
  }
  return parameters;
}

std::vector<unsigned> warp::Builder::inoutArguments(const std::string &name) {
  const BuiltinSpec *spec = lookupBuiltin(name);
  std::vector<unsigned> positions;
  if (!spec)
    return positions;
  for (StringRef overload : spec->overloads)
    for (auto [i, parameter] : llvm::enumerate(parametersOf(overload)))
      if (parameter.split(':').second.ltrim().starts_with("inout ") &&
          !llvm::is_contained(positions, i))
        positions.push_back(i);
  return positions;
}

std::vector<std::vector<std::string>>
warp::Builder::parameterNames(const std::string &name) {
  const BuiltinSpec *spec = lookupBuiltin(name);
  std::vector<std::vector<std::string>> names;
  if (!spec)
    return names;
  for (StringRef overload : spec->overloads) {
    names.emplace_back();
    for (StringRef parameter : parametersOf(overload))
      names.back().push_back(parameter.split(':').first.trim().str());
  }
  return names;
}

warp::Builder::Results warp::Builder::builtin(const std::string &name,
                                              const Values &args) {
  ContextLock lock;
  if (auto built = buildLibraryCall(*impl, name, unwrap(args)))
    return {wrap(ValueRange(*built)), {}};
  const BuiltinSpec *spec = lookupBuiltin(name);
  if (!spec || spec->opName.empty() || spec->isSpecial)
    impl->fail(Error::Kind::Key, "no builtin '" + name + "'");
  SmallVector<mlir::Value, 4> operands = unwrap(args);
  if (operands.size() == 2 && isComparison(name)) {
    mlir::Type a = operands[0].getType(), b = operands[1].getType();
    if (a != b && isScalar(a) && isScalar(b)) {
      mlir::Type common = comparisonType(a, b);
      for (mlir::Value &operand : operands)
        operand = unwrap(cast(wrap(operand), wrap(common)));
    }
  }
  OpBuilder &b = impl->builder;
  std::string why;
  std::optional<BuiltinMatch> match = matchBuiltin(
      *spec, b.getContext(), TypeRange(ValueRange(operands)), &why);
  if (!match)
    impl->failType(why);
  for (TypedAttr value : match->defaults)
    operands.push_back(impl->constant(value));
  OperationState state(impl->loc, spec->opName);
  state.addOperands(operands);
  state.addTypes(match->results);
  SmallVector<mlir::Value, 2> values = impl->fold(b.create(state));
  Results results;
  size_t plain = values.size() - match->inout.size();
  for (size_t i = 0; i < plain; ++i)
    results.values.push_back(wrap(values[i]));
  for (auto [i, position] : llvm::enumerate(match->inout))
    results.inout.emplace_back(position, wrap(values[plain + i]));
  return results;
}

warp::Builder::Values warp::Builder::tid(int dimensions) {
  ContextLock lock;
  if (dimensions < 1 || dimensions > 4)
    impl->fail(Error::Kind::Value, "expects 1 to 4 thread indices, but got " +
                                       std::to_string(dimensions));
  mlir::Type type = impl->builder.getIntegerType(32, /*isSigned=*/true);
  SmallVector<mlir::Type> types(dimensions, type);
  return wrap(TidOp::create(impl->builder, impl->loc, types).getResults());
}

void warp::Builder::printf(const std::string &format, const Values &args) {
  ContextLock lock;
  Diagnostics diagnostics;
  SmallVector<mlir::Value> operands = unwrap(args);
  for (mlir::Value operand : operands)
    if (!isScalar(operand.getType()))
      impl->failType("printf expects scalars, but got " +
                     quoted(operand.getType()));
  if (operands.size() > 32)
    impl->failType("printf expects at most 32 values, but got " +
                   std::to_string(operands.size()));
  auto op = PrintfOp::create(impl->builder, impl->loc, format, operands);
  if (failed(op.verify())) {
    op.erase();
    throw diagnostics.toError(Error::Kind::Type, "bad format");
  }
}

void warp::Builder::require(Value condition, const std::string &message) {
  ContextLock lock;
  AssertOp::create(impl->builder, impl->loc, unwrap(condition), message,
                   /*always=*/true);
}

void warp::Builder::assertion(Value condition, const std::string &message) {
  ContextLock lock;
  AssertOp::create(impl->builder, impl->loc, unwrap(condition), message);
}

//===----------------------------------------------------------------------===//
// Conversion and construction
//===----------------------------------------------------------------------===//

warp::Value warp::Builder::cast(Value value, Type type) {
  ContextLock lock;
  mlir::Value source = unwrap(value);
  mlir::Type wanted = unwrap(type), given = source.getType();
  if (wanted == given)
    return value;
  bool possible =
      (isScalar(given) && isScalar(wanted)) ||
      (isComposite(given) && isComposite(wanted) &&
       withElementScalar(given, getElementScalar(wanted)) == wanted);
  if (!possible)
    impl->failType("cannot convert " + quoted(given) + " to " + quoted(wanted));
  Operation *op = CastOp::create(impl->builder, impl->loc, wanted, source);
  return wrap(impl->fold(op).front());
}

warp::Value warp::Builder::bitcast(Value value, Type type) {
  ContextLock lock;
  mlir::Type wanted = unwrap(type), given = unwrap(value).getType();
  if (!isArrayElement(given) || !isArrayElement(wanted) ||
      getByteSize(given) != getByteSize(wanted))
    impl->failType("cannot reinterpret " + quoted(given) + " as " +
                   quoted(wanted) + ", sizes differ");
  return wrap(BitcastOp::create(impl->builder, impl->loc, wanted, unwrap(value))
                  .getResult());
}

warp::Value warp::Builder::construct(Type type, const Values &args) {
  ContextLock lock;
  mlir::Type wanted = unwrap(type);
  SmallVector<mlir::Value> operands = unwrap(args);
  mlir::Type scalar = getElementScalar(wanted);
  int64_t expected = getComponentCount(wanted), given = 0;
  for (mlir::Value operand : operands) {
    mlir::Type have = operand.getType();
    if (!isScalar(have) && !isComposite(have))
      impl->failType(quoted(wanted) + " cannot be made from " + quoted(have));
    if (getElementScalar(have) != scalar)
      impl->failType(
          "components of " + quoted(wanted) + " are " + quoted(scalar) +
          ", but got " + quotedTypes(TypeRange(ValueRange(operands))) +
          "\nhint: convert with `" + getPythonName(scalar) + "(...)`");
    given += getComponentCount(have);
  }
  bool fill = operands.size() == 1 && isScalar(operands[0].getType());
  if (given != expected && given != 0 && !fill)
    impl->failType(quoted(wanted) + " expects " + std::to_string(expected) +
                   " components, or 1 for all, but got " +
                   std::to_string(given));
  if (operands.size() == 1 && operands[0].getType() == wanted)
    return args[0];
  return wrap(ConstructOp::create(impl->builder, impl->loc, wanted, operands)
                  .getResult());
}

//===----------------------------------------------------------------------===//
// Components and fields
//===----------------------------------------------------------------------===//

mlir::Type warp::checkedPart(Builder::Impl &impl, mlir::Type composite,
                             ValueRange indices) {
  for (mlir::Value index : indices)
    if (!isInteger(index.getType()))
      impl.failType("index of " + quoted(composite) +
                    " must be an integer, but got " + quoted(index.getType()) +
                    "\nhint: use `int(...)`");
  mlir::Type part = isComposite(composite)
                        ? getIndexedType(composite, indices.size())
                        : mlir::Type();
  if (!part)
    impl.failType(quoted(composite) + " cannot be indexed by " +
                  std::to_string(indices.size()) + " indices");
  SmallVector<int64_t, 2> extents = getIndexExtents(composite);
  for (auto [index, extent] : llvm::zip(indices, extents)) {
    auto known = wrap(index).constant();
    const int64_t *number = known ? std::get_if<int64_t>(&*known) : nullptr;
    if (number && (*number < -extent || *number >= extent))
      impl.fail(Error::Kind::Index, "index " + std::to_string(*number) +
                                        " is out of range for " +
                                        quoted(composite) + " with " +
                                        std::to_string(extent) + " elements");
  }
  return part;
}

warp::Value warp::Builder::extract(Value composite, const Values &indices) {
  ContextLock lock;
  mlir::Value source = unwrap(composite);
  SmallVector<mlir::Value> at = unwrap(indices);
  mlir::Type part = checkedPart(*impl, source.getType(), at);
  return wrap(ExtractOp::create(impl->builder, impl->loc, part, source, at)
                  .getResult());
}

warp::Type warp::Builder::partType(Type composite, const Values &indices) {
  ContextLock lock;
  return wrap(checkedPart(*impl, unwrap(composite), unwrap(indices)));
}

warp::Value warp::Builder::position(Value index, int64_t extent) {
  ContextLock lock;
  mlir::Value given = unwrap(index);
  if (!isInteger(given.getType()))
    impl->failType("array index must be an integer, but got " +
                   quoted(given.getType()) + "\nhint: use `int(...)`");
  mlir::Type result = impl->builder.getIntegerType(32, /*isSigned=*/true);
  return wrap(
      PositionOp::create(impl->builder, impl->loc, result, given, extent)
          .getResult());
}

static DenseElementsAttr makeTable(ShapedType type, StringRef bytes) {
  if (!warp::isBool(type.getElementType()))
    return DenseElementsAttr::getFromRawBuffer(type,
                                               {bytes.data(), bytes.size()});
  auto values = llvm::map_to_vector(bytes, [](char byte) { return byte != 0; });
  return DenseElementsAttr::get(type, ArrayRef<bool>(values));
}

warp::Value warp::Builder::tableGet(Type element,
                                    const std::vector<int64_t> &shape,
                                    const std::string &bytes,
                                    const Values &indices) {
  ContextLock lock;
  mlir::Type scalar = unwrap(element);
  if (!isScalar(scalar) || shape.size() != indices.size())
    impl->failType("a table of " + quoted(scalar) + " with " +
                   std::to_string(shape.size()) +
                   " dimensions cannot be indexed by " +
                   std::to_string(indices.size()) + " indices");
  for (auto [index, extent] : llvm::zip(indices, shape)) {
    if (!isInteger(unwrap(index).getType()))
      impl->failType("table index must be an integer, but got " +
                     quoted(unwrap(index).getType()) +
                     "\nhint: use `int(...)`");
    auto known = index.constant();
    const int64_t *number = known ? std::get_if<int64_t>(&*known) : nullptr;
    if (number && (*number < -extent || *number >= extent))
      impl->fail(Error::Kind::Index, "index " + std::to_string(*number) +
                                         " is out of range for a table with " +
                                         std::to_string(extent) + " elements");
  }
  SmallVector<mlir::Value> at = unwrap(indices);
  auto type = RankedTensorType::get(shape, scalar);
  return wrap(TableGetOp::create(impl->builder, impl->loc, scalar,
                                 makeTable(type, bytes), at)
                  .getResult());
}

warp::Value warp::Builder::insert(Value composite, const Values &indices,
                                  Value part) {
  ContextLock lock;
  mlir::Value target = unwrap(composite), value = unwrap(part);
  SmallVector<mlir::Value> at = unwrap(indices);
  mlir::Type wanted = checkedPart(*impl, target.getType(), at);
  if (value.getType() != wanted)
    impl->failType("part of " + quoted(target.getType()) + " is " +
                   quoted(wanted) + ", but got " + quoted(value.getType()));
  return wrap(InsertOp::create(impl->builder, impl->loc, target.getType(),
                               value, target, at)
                  .getResult());
}

/// Type of a field; an error names the fields there are.
static mlir::Type fieldType(warp::Builder::Impl &impl, mlir::Type type,
                            const std::string &field) {
  using namespace warp;
  auto structType = dyn_cast<StructType>(type);
  if (!structType)
    impl.failType("expects a struct, but got " + quoted(type));
  int64_t index = structType.getFieldIndex(field);
  if (index >= 0)
    return structType.getFieldTypes()[index];
  std::string names;
  for (StringAttr name : structType.getFieldNames())
    names += (names.empty() ? "" : ", ") + name.str();
  impl.fail(Error::Kind::Attribute, "struct " + quoted(type) +
                                        " has no field '" + field +
                                        "', it has: " + names);
}

warp::Value warp::Builder::structCreate(Type type, const Values &fields) {
  ContextLock lock;
  auto wanted = dyn_cast<StructType>(unwrap(type));
  SmallVector<mlir::Value> values = unwrap(fields);
  if (!wanted)
    impl->failType("expects a struct, but got " + quoted(unwrap(type)));
  if (TypeRange(wanted.getFieldTypes()) != TypeRange(ValueRange(values)))
    impl->failType("struct " + quoted(wanted) + " expects " +
                   quotedTypes(wanted.getFieldTypes()) + ", but got " +
                   quotedTypes(TypeRange(ValueRange(values))));
  return wrap(StructCreateOp::create(impl->builder, impl->loc, wanted, values)
                  .getResult());
}

warp::Value warp::Builder::structGet(Value value, const std::string &field) {
  ContextLock lock;
  mlir::Value source = unwrap(value);
  mlir::Type type = fieldType(*impl, source.getType(), field);
  return wrap(StructGetOp::create(impl->builder, impl->loc, type, source, field)
                  .getResult());
}

warp::Value warp::Builder::structSet(Value value, const std::string &field,
                                     Value part) {
  ContextLock lock;
  mlir::Value target = unwrap(value), set = unwrap(part);
  mlir::Type type = fieldType(*impl, target.getType(), field);
  if (set.getType() != type)
    impl->failType("field '" + field + "' of struct " +
                   quoted(target.getType()) + " is " + quoted(type) +
                   ", but got " + quoted(set.getType()));
  return wrap(StructSetOp::create(impl->builder, impl->loc, target.getType(),
                                  set, target, field)
                  .getResult());
}

//===- Types.cpp - Handles of types and values ----------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "BuilderImpl.h"

#include "WarpDialect/TileTypes.h"

#include "mlir/AsmParser/AsmParser.h"

#include "llvm/ADT/TypeSwitch.h"
#include "llvm/Support/raw_ostream.h"

using namespace mlir;

warp::Builder::Values warp::wrap(ValueRange values) {
  Builder::Values wrapped;
  wrapped.reserve(values.size());
  for (mlir::Value value : values)
    wrapped.push_back(wrap(value));
  return wrapped;
}

SmallVector<mlir::Value, 4> warp::unwrap(const Builder::Values &values) {
  SmallVector<mlir::Value, 4> unwrapped;
  for (Value value : values)
    unwrapped.push_back(unwrap(value));
  return unwrapped;
}

std::string warp::quotedTypes(TypeRange types) {
  std::string text;
  for (auto [i, type] : llvm::enumerate(types)) {
    if (i != 0)
      text += i + 1 == types.size() ? " and " : ", ";
    text += quoted(type);
  }
  return text;
}

warp::Type warp::Type::parse(std::string_view text) {
  ContextLock lock;
  Diagnostics diagnostics;
  size_t read = 0;
  mlir::Type type = parseType(StringRef(text.data(), text.size()),
                              &compilerContext(), &read);
  if (!type || read != text.size())
    throw diagnostics.toError(Error::Kind::Parse,
                              "expects a type, but got '" + std::string(text) +
                                  "'");
  return wrap(type);
}

std::string warp::Type::str() const {
  ContextLock lock;
  std::string text;
  llvm::raw_string_ostream stream(text);
  unwrap(*this).print(stream);
  return text;
}

std::string warp::Type::pythonName() const {
  return getPythonName(unwrap(*this));
}

warp::Type::Kind warp::Type::kind() const {
  mlir::Type type = unwrap(*this);
  if (isBool(type))
    return Kind::Bool;
  if (isFloat(type))
    return Kind::Float;
  if (isInteger(type))
    return Kind::Int;
  return llvm::TypeSwitch<mlir::Type, Kind>(type)
      .Case<VecType>([](auto) { return Kind::Vector; })
      .Case<MatType>([](auto) { return Kind::Matrix; })
      .Case<QuatType>([](auto) { return Kind::Quaternion; })
      .Case<TransformType>([](auto) { return Kind::Transform; })
      .Case<ArrayType>([](auto) { return Kind::Array; })
      .Case<StructType>([](auto) { return Kind::Struct; })
      .Case<TileType>([](auto) { return Kind::Tile; })
      .Default(Kind::Other);
}

int warp::Type::width() const {
  mlir::Type type = unwrap(*this);
  return type.isIntOrFloat() ? type.getIntOrFloatBitWidth() : 0;
}

bool warp::Type::isSigned() const { return unwrap(*this).isSignedInteger(); }

warp::Type warp::Type::element() const {
  mlir::Type type = unwrap(*this);
  if (auto array = dyn_cast<ArrayType>(type))
    return wrap(array.getElementType());
  if (auto tile = dyn_cast<TileType>(type))
    return wrap(tile.getElementType());
  return isComposite(type) ? wrap(getElementScalar(type)) : Type();
}

std::vector<int64_t> warp::Type::shape() const {
  mlir::Type type = unwrap(*this);
  if (auto vec = dyn_cast<VecType>(type))
    return {vec.getLength()};
  if (auto mat = dyn_cast<MatType>(type))
    return {mat.getRows(), mat.getCols()};
  if (auto tile = dyn_cast<TileType>(type))
    return tile.getShape().vec();
  return {};
}

int warp::Type::rank() const {
  auto array = dyn_cast<ArrayType>(unwrap(*this));
  return array ? array.getRank() : 0;
}

std::string warp::Type::structName() const {
  auto type = dyn_cast<StructType>(unwrap(*this));
  return type ? type.getName().str() : std::string();
}

std::vector<warp::Type::Field> warp::Type::fields() const {
  std::vector<Field> fields;
  if (auto type = dyn_cast<StructType>(unwrap(*this)))
    for (auto [name, field] :
         llvm::zip_equal(type.getFieldNames(), type.getFieldTypes()))
      fields.push_back({name.str(), wrap(field)});
  return fields;
}

int64_t warp::Type::byteSize() const { return getByteSize(unwrap(*this)); }
int64_t warp::Type::byteAlign() const { return getByteAlign(unwrap(*this)); }

warp::Type warp::Value::type() const { return wrap(unwrap(*this).getType()); }

std::optional<warp::Number> warp::Value::constant() const {
  auto constant = unwrap(*this).getDefiningOp<ConstantOp>();
  if (!constant)
    return std::nullopt;
  if (auto number = dyn_cast<FloatAttr>(constant.getValue()))
    return number.getValueAsDouble();
  auto number = dyn_cast<IntegerAttr>(constant.getValue());
  if (!number)
    return std::nullopt;
  APInt bits = number.getValue();
  if (bits.getBitWidth() == 1)
    return bits.getBoolValue();
  if (!number.getType().isUnsignedInteger())
    return bits.getSExtValue();
  if (bits.isIntN(63))
    return static_cast<int64_t>(bits.getZExtValue());
  return bits.getZExtValue();
}

//===- TypeQueries.cpp - Queries about types ------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "WarpDialect/TileTypes.h"
#include "warp/Launch.h"

#include "llvm/ADT/StringExtras.h"
#include "llvm/ADT/TypeSwitch.h"
#include "llvm/Support/MathExtras.h"

using namespace mlir;

//===----------------------------------------------------------------------===//
// Kinds
//===----------------------------------------------------------------------===//

static bool hasMachineWidth(IntegerType type) {
  unsigned width = type.getWidth();
  return width == 8 || width == 16 || width == 32 || width == 64;
}

bool warp::isBool(mlir::Type type) { return type.isSignlessInteger(1); }

bool warp::isInteger(mlir::Type type) {
  auto integer = dyn_cast<IntegerType>(type);
  return integer && hasMachineWidth(integer);
}

bool warp::isFloat(mlir::Type type) {
  return isa<Float16Type, BFloat16Type, Float32Type, Float64Type>(type);
}

bool warp::isScalar(mlir::Type type) {
  if (isBool(type) || isFloat(type))
    return true;
  return isInteger(type) && !type.isSignlessInteger();
}

bool warp::isThreadScalar(mlir::Type type) {
  return isBool(type) || isFloat(type) || isInteger(type);
}

bool warp::isComposite(mlir::Type type) {
  return isa<VecType, MatType, QuatType, TransformType>(type);
}

/// A tree of selects takes as many operations as there are numbers; memory
/// takes a few, of which CPUs do those that differ from lane to lane one by
/// one. Measured on Cascade Lake: even at 8 numbers, twice as fast at 32.
static constexpr int64_t maxSelected = 9;

bool warp::isLongComposite(mlir::Type type) {
  return isa<VecType, MatType>(type) && getComponentCount(type) > maxSelected;
}

bool warp::isArrayElement(mlir::Type type) {
  return isScalar(type) || isComposite(type) || isa<StructType>(type);
}

bool warp::isValue(mlir::Type type) {
  return isArrayElement(type) || isa<ArrayType>(type);
}

//===----------------------------------------------------------------------===//
// Components
//===----------------------------------------------------------------------===//

mlir::Type warp::getElementScalar(mlir::Type type) {
  return TypeSwitch<mlir::Type, mlir::Type>(type)
      .Case<VecType, MatType, QuatType, TransformType>(
          [](auto composite) { return composite.getElementType(); })
      .Default([](mlir::Type other) {
        return isThreadScalar(other) ? other : mlir::Type();
      });
}

mlir::Type warp::withElementScalar(mlir::Type type, mlir::Type scalar) {
  if (isThreadScalar(type))
    return scalar;
  bool takesFloats = isa<QuatType, TransformType>(type);
  if (takesFloats ? !isFloat(scalar) : !isScalar(scalar))
    return {};
  MLIRContext *context = type.getContext();
  return TypeSwitch<mlir::Type, mlir::Type>(type)
      .Case([&](VecType vec) {
        return VecType::get(context, vec.getLength(), scalar);
      })
      .Case([&](MatType mat) {
        return MatType::get(context, mat.getRows(), mat.getCols(), scalar);
      })
      .Case([&](QuatType) { return QuatType::get(context, scalar); })
      .Case([&](TransformType) { return TransformType::get(context, scalar); })
      .Default([](mlir::Type) { return mlir::Type(); });
}

mlir::Type warp::getGradientElement(mlir::Type element) {
  mlir::Type scalar = getElementScalar(element);
  if (!scalar || !isFloat(scalar) || scalar.getIntOrFloatBitWidth() > 16)
    return element;
  return withElementScalar(element, Float32Type::get(element.getContext()));
}

mlir::Type warp::getSignless(mlir::Type type) {
  auto integer = dyn_cast<IntegerType>(type);
  if (!integer || integer.isSignless())
    return type;
  return IntegerType::get(type.getContext(), integer.getWidth());
}

int64_t warp::getComponentCount(mlir::Type type) {
  return TypeSwitch<mlir::Type, int64_t>(type)
      .Case([](VecType t) { return t.getLength(); })
      .Case([](MatType t) { return t.getRows() * t.getCols(); })
      .Case([](QuatType) { return 4; })
      .Case([](TransformType) { return 7; })
      .Case([](StructType t) {
        int64_t count = 0;
        for (mlir::Type field : t.getFieldTypes())
          count += getComponentCount(field);
        return count;
      })
      .Default([](mlir::Type) { return 1; });
}

void warp::flatten(mlir::Type type, SmallVectorImpl<mlir::Type> &components) {
  if (auto structure = dyn_cast<StructType>(type)) {
    for (mlir::Type field : structure.getFieldTypes())
      flatten(field, components);
    return;
  }
  if (isComposite(type))
    components.append(getComponentCount(type), getElementScalar(type));
  else
    components.push_back(type);
}

mlir::Type warp::getIndexedType(mlir::Type composite, size_t indices) {
  if (auto matrix = dyn_cast<MatType>(composite)) {
    if (indices == 1)
      return VecType::get(matrix.getContext(), matrix.getCols(),
                          matrix.getElementType());
    return indices == 2 ? matrix.getElementType() : mlir::Type();
  }
  return indices == 1 && isComposite(composite) ? getElementScalar(composite)
                                                : mlir::Type();
}

mlir::Type warp::getFieldType(mlir::Type type, StringRef field) {
  if (auto structure = dyn_cast<StructType>(type)) {
    int64_t index = structure.getFieldIndex(field);
    return index < 0 ? mlir::Type() : structure.getFieldTypes()[index];
  }
  if (!isa<TransformType>(type))
    return {};
  mlir::Type scalar = getElementScalar(type);
  if (field == "p")
    return VecType::get(type.getContext(), 3, scalar);
  return field == "q" ? QuatType::get(type.getContext(), scalar) : mlir::Type();
}

SmallVector<int64_t, 2> warp::getIndexExtents(mlir::Type composite) {
  if (auto matrix = dyn_cast<MatType>(composite))
    return {matrix.getRows(), matrix.getCols()};
  return {int64_t(getComponentCount(composite))};
}

//===----------------------------------------------------------------------===//
// Layout
//===----------------------------------------------------------------------===//

static int64_t getScalarSize(mlir::Type type) {
  return llvm::divideCeil(type.getIntOrFloatBitWidth(), 8);
}

int64_t warp::getByteAlign(mlir::Type type) {
  if (isa<ArrayType>(type))
    return alignof(ArrayDescriptor);
  if (auto structure = dyn_cast<StructType>(type)) {
    int64_t align = 1;
    for (mlir::Type field : structure.getFieldTypes())
      align = std::max(align, getByteAlign(field));
    return align;
  }
  return getScalarSize(getElementScalar(type));
}

/// Offset of the end of a struct, or of field `stop`.
static int64_t layOut(warp::StructType type, int64_t stop) {
  int64_t offset = 0;
  for (auto [index, field] : llvm::enumerate(type.getFieldTypes())) {
    offset = llvm::alignTo(offset, warp::getByteAlign(field));
    if (int64_t(index) == stop)
      return offset;
    offset += warp::getByteSize(field);
  }
  return llvm::alignTo(offset, warp::getByteAlign(type));
}

int64_t warp::getByteSize(mlir::Type type) {
  if (isa<ArrayType>(type))
    return sizeof(ArrayDescriptor);
  if (auto structure = dyn_cast<StructType>(type))
    return layOut(structure, -1);
  return getComponentCount(type) * getScalarSize(getElementScalar(type));
}

int64_t warp::getFieldOffset(StructType type, int64_t field) {
  return layOut(type, field);
}

//===----------------------------------------------------------------------===//
// Python names
//===----------------------------------------------------------------------===//

static std::string getScalarName(mlir::Type type) {
  if (warp::isBool(type))
    return "bool";
  if (type.isBF16())
    return "bfloat16";
  unsigned width = type.getIntOrFloatBitWidth();
  StringRef kind = isa<FloatType>(type)            ? "float"
                   : type.isUnsignedInteger(width) ? "uint"
                                                   : "int";
  return (kind + Twine(width)).str();
}

/// Suffix of the peer's short names, such as the f of vec3f.
static StringRef getScalarSuffix(mlir::Type type) {
  if (isa<FloatType>(type))
    return type.isF32() ? "f" : type.isF64() ? "d" : type.isF16() ? "h" : "";
  if (warp::isBool(type))
    return "";
  static constexpr StringRef signedOnes[] = {"b", "s", "i", "l"};
  static constexpr StringRef unsignedOnes[] = {"ub", "us", "ui", "ul"};
  unsigned width = type.getIntOrFloatBitWidth();
  unsigned rank = llvm::Log2_32(width) - 3;
  return type.isUnsignedInteger(width) ? unsignedOnes[rank] : signedOnes[rank];
}

static std::string getVecName(warp::VecType type) {
  StringRef suffix = getScalarSuffix(type.getElementType());
  if (type.getLength() >= 2 && type.getLength() <= 4 && !suffix.empty())
    return ("vec" + Twine(type.getLength()) + suffix).str();
  return "vector(length=" + std::to_string(type.getLength()) +
         ", dtype=" + getScalarName(type.getElementType()) + ")";
}

static std::string getMatName(warp::MatType type) {
  int64_t rows = type.getRows(), cols = type.getCols();
  StringRef suffix = getScalarSuffix(type.getElementType());
  if (rows == cols && rows >= 2 && rows <= 4 && !suffix.empty() &&
      isa<FloatType>(type.getElementType()))
    return ("mat" + Twine(rows) + Twine(cols) + suffix).str();
  return ("matrix(shape=(" + Twine(rows) + ", " + Twine(cols) +
          "), dtype=" + getScalarName(type.getElementType()) + ")")
      .str();
}

static std::string getArrayName(warp::ArrayType type) {
  std::string text =
      "array(dtype=" + warp::getPythonName(type.getElementType());
  if (type.getRank() > 1)
    text += ", ndim=" + std::to_string(type.getRank());
  return text + ")";
}

static std::string getTileName(warp::TileType type) {
  std::string text;
  llvm::raw_string_ostream out(text);
  out << "tile(dtype=" << warp::getPythonName(type.getElementType())
      << ", shape=(";
  llvm::interleaveComma(type.getShape(), out);
  out << (type.getRank() == 1 ? ",))" : "))");
  return text;
}

std::string warp::getPythonName(mlir::Type type) {
  return TypeSwitch<mlir::Type, std::string>(type)
      .Case([](VecType t) { return getVecName(t); })
      .Case([](MatType t) { return getMatName(t); })
      .Case([](QuatType t) {
        return ("quat" + getScalarSuffix(t.getElementType())).str();
      })
      .Case([](TransformType t) {
        return ("transform" + getScalarSuffix(t.getElementType())).str();
      })
      .Case([](ArrayType t) { return getArrayName(t); })
      .Case([](StructType t) { return t.getName().str(); })
      .Case([](TileType t) { return getTileName(t); })
      .Default([](mlir::Type t) {
        if (isThreadScalar(t))
          return getScalarName(t);
        std::string text;
        llvm::raw_string_ostream(text) << t;
        return text;
      });
}

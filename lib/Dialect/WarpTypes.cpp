//===- WarpTypes.cpp - Types of the warp dialect --------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Printing, parsing and verification of the types. Queries about a type
// a type is in TypeQueries.cpp.
//
//===----------------------------------------------------------------------===//

#include "WarpDialect/WarpTypes.h"
#include "WarpDialect/TileTypes.h"
#include "WarpDialect/WarpDialect.h"

#include "mlir/IR/Builders.h"
#include "mlir/IR/DialectImplementation.h"
#include "llvm/ADT/SmallPtrSet.h"
#include "llvm/ADT/StringExtras.h"
#include "llvm/ADT/TypeSwitch.h"

using namespace mlir;

//===----------------------------------------------------------------------===//
// Syntax
//===----------------------------------------------------------------------===//

/// `3x4 x`, which the lexer would take for something else.
static ParseResult parseMatShape(AsmParser &parser, int64_t &rows,
                                 int64_t &cols) {
  SmallVector<int64_t, 2> extents;
  SMLoc place = parser.getCurrentLocation();
  if (parser.parseDimensionList(extents, /*allowDynamic=*/false,
                                /*withTrailingX=*/true))
    return failure();
  if (extents.size() != 2)
    return parser.emitError(place, "expects the shape of a matrix as "
                                   "'rows x cols', but got ")
           << extents.size() << " extents";
  rows = extents[0];
  cols = extents[1];
  return success();
}

static void printMatShape(AsmPrinter &printer, int64_t rows, int64_t cols) {
  printer << rows << 'x' << cols << " x";
}

/// `16x16 x`.
static ParseResult parseTileShape(AsmParser &parser,
                                  SmallVector<int64_t> &shape) {
  return parser.parseDimensionList(shape, /*allowDynamic=*/false,
                                   /*withTrailingX=*/true);
}

static void printTileShape(AsmPrinter &printer, ArrayRef<int64_t> shape) {
  llvm::interleave(shape, printer.getStream(), "x");
  printer << " x";
}

namespace {
/// Counts how deep the parser is inside our types. Text may nest without
/// bound, the stack may not.
struct NestingGuard {
  static constexpr int limit = 64;
  static thread_local int depth;
  NestingGuard() { ++depth; }
  ~NestingGuard() { --depth; }
};
thread_local int NestingGuard::depth = 0;
} // namespace

/// A type inside another one.
static ParseResult parseNested(AsmParser &parser, mlir::Type &type) {
  NestingGuard guard;
  if (NestingGuard::depth > NestingGuard::limit)
    return parser.emitError(parser.getCurrentLocation(),
                            "types nest deeper than ")
           << NestingGuard::limit << " levels";
  return parser.parseType(type);
}

static void printNested(AsmPrinter &printer, mlir::Type type) {
  printer << type;
}

#define GET_TYPEDEF_CLASSES
#include "WarpDialect/WarpTypes.cpp.inc"

void warp::WarpDialect::registerTypes() {
  addTypes<
#define GET_TYPEDEF_LIST
#include "WarpDialect/WarpTypes.cpp.inc"
      >();
}

mlir::Type warp::StructType::parse(AsmParser &parser) {
  SMLoc place = parser.getCurrentLocation();
  std::string name;
  SmallVector<StringAttr> fieldNames;
  SmallVector<mlir::Type> fieldTypes;
  auto parseField = [&]() -> ParseResult {
    std::string field;
    mlir::Type type;
    if (parser.parseKeywordOrString(&field) || parser.parseColon() ||
        parseNested(parser, type))
      return failure();
    fieldNames.push_back(parser.getBuilder().getStringAttr(field));
    fieldTypes.push_back(type);
    return success();
  };
  if (parser.parseLess() || parser.parseString(&name) || parser.parseComma() ||
      parser.parseCommaSeparatedList(AsmParser::Delimiter::Braces,
                                     parseField) ||
      parser.parseGreater())
    return {};
  return parser.getChecked<StructType>(place, parser.getContext(), name,
                                       fieldNames, fieldTypes);
}

void warp::StructType::print(AsmPrinter &printer) const {
  printer << "<\"";
  llvm::printEscapedString(getName(), printer.getStream());
  printer << "\", {";
  llvm::interleaveComma(
      llvm::zip(getFieldNames(), getFieldTypes()), printer, [&](auto field) {
        printer.printKeywordOrString(std::get<0>(field).getValue());
        printer << ": " << std::get<1>(field);
      });
  printer << "}>";
}

int64_t warp::StructType::getFieldIndex(StringRef field) const {
  for (auto [index, name] : llvm::enumerate(getFieldNames()))
    if (name.getValue() == field)
      return index;
  return -1;
}

//===----------------------------------------------------------------------===//
// Verification
//===----------------------------------------------------------------------===//

using EmitError = llvm::function_ref<InFlightDiagnostic()>;

static LogicalResult verifyScalarElement(EmitError emitError, mlir::Type type,
                                         StringRef label) {
  if (type && warp::isScalar(type))
    return success();
  return emitError() << label << " expects a scalar element type, but got "
                     << type;
}

static LogicalResult verifyFloatElement(EmitError emitError, mlir::Type type) {
  if (type && warp::isFloat(type))
    return success();
  return emitError() << "(C1) expects a floating-point element type, but got "
                     << type;
}

LogicalResult warp::VecType::verify(EmitError emitError, int64_t length,
                                    mlir::Type elementType) {
  if (length < 1 || length > maxComponents)
    return emitError() << "(C1) expects a length between 1 and "
                       << maxComponents << ", but got " << length;
  return verifyScalarElement(emitError, elementType, "(C2)");
}

LogicalResult warp::MatType::verify(EmitError emitError, int64_t rows,
                                    int64_t cols, mlir::Type elementType) {
  if (rows < 1 || cols < 1 || rows > maxComponents || cols > maxComponents ||
      rows * cols > maxComponents)
    return emitError() << "(C1) expects a shape of 1 to " << maxComponents
                       << " components, but got '" << rows << 'x' << cols
                       << "'";
  return verifyScalarElement(emitError, elementType, "(C2)");
}

LogicalResult warp::QuatType::verify(EmitError emitError,
                                     mlir::Type elementType) {
  return verifyFloatElement(emitError, elementType);
}

LogicalResult warp::TransformType::verify(EmitError emitError,
                                          mlir::Type elementType) {
  return verifyFloatElement(emitError, elementType);
}

LogicalResult warp::ArrayType::verify(EmitError emitError, int64_t rank,
                                      mlir::Type elementType) {
  if (rank < 1 || rank > 4)
    return emitError() << "(C1) expects a rank of 1 to 4, but got " << rank;
  if (!elementType || !isArrayElement(elementType))
    return emitError() << "(C2) expects a scalar, composite or struct as "
                          "element type, but got "
                       << elementType;
  return success();
}

int64_t warp::TileType::getNumElements() const {
  int64_t count = 1;
  for (int64_t extent : getShape())
    count *= extent;
  return count;
}

LogicalResult warp::TileType::verify(EmitError emitError,
                                     ArrayRef<int64_t> shape,
                                     mlir::Type elementType) {
  constexpr int64_t most = 1 << 24;
  if (shape.empty() || shape.size() > 4)
    return emitError() << "(C1) expects a rank of 1 to 4, but got "
                       << shape.size();
  if (!elementType || !isArrayElement(elementType))
    return emitError() << "(C2) expects a scalar, composite or struct as "
                          "element type, but got "
                       << elementType;
  int64_t components = getComponentCount(elementType);
  for (int64_t extent : shape) {
    if (extent < 1)
      return emitError() << "(C1) expects extents of 1 or more, but got "
                         << extent;
    if (extent > most / components)
      return emitError() << "(C3) expects at most " << most << " components";
    components *= extent;
  }
  return success();
}

namespace {
/// The cost of a walk over a type, element types of arrays included.
struct Extent {
  int64_t parts = 1;
  int64_t depth = 0;
};
} // namespace

static Extent measure(mlir::Type type) {
  if (auto array = dyn_cast<warp::ArrayType>(type))
    return measure(array.getElementType());
  auto structure = dyn_cast<warp::StructType>(type);
  if (!structure)
    return {warp::getComponentCount(type), 0};
  Extent sum{1, 1};
  for (mlir::Type field : structure.getFieldTypes()) {
    Extent part = measure(field);
    sum.parts += part.parts;
    sum.depth = std::max(sum.depth, part.depth + 1);
  }
  return sum;
}

LogicalResult warp::StructType::verify(EmitError emitError, StringRef name,
                                       ArrayRef<StringAttr> fieldNames,
                                       ArrayRef<mlir::Type> fieldTypes) {
  if (fieldNames.size() != fieldTypes.size())
    return emitError() << "expects as many field names as types, but got "
                       << fieldNames.size() << " and " << fieldTypes.size();
  llvm::SmallPtrSet<Attribute, 8> seen;
  int64_t parts = 1;
  for (auto [fieldName, type] : llvm::zip(fieldNames, fieldTypes)) {
    if (!fieldName || fieldName.getValue().empty())
      return emitError() << "(C1) struct '" << name
                         << "' has a field without name";
    if (!seen.insert(fieldName).second)
      return emitError() << "(C1) struct '" << name << "' has two fields '"
                         << fieldName.getValue() << "'";
    if (!type || !isValue(type))
      return emitError() << "(C2) field '" << fieldName.getValue()
                         << "' must be a scalar, composite, array or struct, "
                            "but is "
                         << type;
    Extent extent = measure(type);
    parts += extent.parts;
    if (parts > maxComponents || extent.depth >= NestingGuard::limit)
      return emitError() << "(C3) struct '" << name << "' has more than "
                         << maxComponents << " components or "
                         << NestingGuard::limit << " levels";
  }
  return success();
}

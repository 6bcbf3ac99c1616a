//===- WarpOps.cpp - Verification of scalar and composite operations ------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Each check carries the label of the constraint it enforces, as the op's
// description numbers them. Array operations are in ArrayOps.cpp, builtins in
// Registry.cpp, simplifications in the *Folds.cpp files.
//
//===----------------------------------------------------------------------===//

#include "WarpDialect/WarpOps.h"
#include "Checks.h"
#include "WarpDialect/LaneOps.h"
#include "WarpDialect/LibraryOps.h"
#include "WarpDialect/TileOps.h"
#include "WarpDialect/WarpDialect.h"

#include "mlir/IR/Builders.h"
#include "mlir/IR/Matchers.h"
#include "llvm/ADT/APSInt.h"
#include "llvm/ADT/StringExtras.h"

using namespace mlir;

#include "WarpDialect/WarpEnums.cpp.inc"
#include "WarpDialect/WarpInterfaces.cpp.inc"

#define GET_OP_CLASSES
#include "WarpDialect/WarpOps.cpp.inc"

#define GET_OP_CLASSES
#include "WarpDialect/WarpLaneOps.cpp.inc"

void warp::WarpDialect::registerOps() {
  addOperations<
#define GET_OP_LIST
#include "WarpDialect/WarpOps.cpp.inc"
      >();
  addOperations<
#define GET_OP_LIST
#include "WarpDialect/WarpLibraryOps.cpp.inc"
      >();
  addOperations<
#define GET_OP_LIST
#include "WarpDialect/WarpLaneOps.cpp.inc"
      >();
  addOperations<
#define GET_OP_LIST
#include "WarpDialect/WarpTileOps.cpp.inc"
      >();
}

//===----------------------------------------------------------------------===//
// Scalars
//===----------------------------------------------------------------------===//

LogicalResult warp::CastOp::verify() {
  mlir::Type from = getSource().getType(), to = getResult().getType();
  auto isNumber = [](mlir::Type type) {
    return isThreadScalar(type) || isa<IndexType>(type);
  };
  if (isNumber(from) && isNumber(to))
    return success();
  if (isComposite(from) && isComposite(to) &&
      withElementScalar(from, getElementScalar(to)) == to)
    return success();
  return emitOpError("(C1) expects two scalars, or two composites of the same "
                     "kind and shape, but got ")
         << from << " and " << to;
}

LogicalResult warp::BitcastOp::verify() {
  int64_t from = getByteSize(getSource().getType());
  int64_t to = getByteSize(getResult().getType());
  if (from == to)
    return success();
  return emitOpError("(C1) expects types of the same size, but ")
         << getSource().getType() << " has " << from << " bytes and "
         << getResult().getType() << " has " << to;
}

//===----------------------------------------------------------------------===//
// Composites
//===----------------------------------------------------------------------===//

LogicalResult warp::ConstructOp::verify() {
  mlir::Type result = getResult().getType();
  int64_t expected = getComponentCount(result), count = 0;
  for (mlir::Type part : getComponents().getTypes()) {
    if (getElementScalar(part) != getElementScalar(result))
      return emitOpError("(C2) expects components of type ")
             << getElementScalar(result) << ", but got " << part;
    count += getComponentCount(part);
  }
  bool fills = getComponents().size() == 1 && count == 1;
  if (count == 0 || fills || count == expected)
    return success();
  return emitOpError("(C1) expects ") << expected << " components, 1 or 0 for "
                                      << result << ", but got " << count;
}

/// Indices of one component or row; `part` is the type of what they select.
static LogicalResult verifyIndexed(Operation *op, mlir::Type composite,
                                   ValueRange indices, mlir::Type part) {
  mlir::Type expected = warp::getIndexedType(composite, indices.size());
  if (!expected)
    return op->emitOpError("(C1) expects ")
           << (isa<warp::MatType>(composite) ? "1 or 2 indices" : "1 index")
           << " for " << composite << ", but got " << indices.size();
  if (part != expected)
    return op->emitOpError("(C2) ")
           << composite << " with " << indices.size()
           << " indices has parts of type " << expected << ", but got " << part;
  return success();
}

LogicalResult warp::ExtractOp::verify() {
  return verifyIndexed(*this, getSource().getType(), getIndices(),
                       getResult().getType());
}

LogicalResult warp::InsertOp::verify() {
  return verifyIndexed(*this, getTarget().getType(), getIndices(),
                       getValue().getType());
}

//===----------------------------------------------------------------------===//
// Structs
//===----------------------------------------------------------------------===//

LogicalResult warp::StructCreateOp::verify() {
  auto type = cast<StructType>(getResult().getType());
  if (getFields().size() != type.getFieldTypes().size())
    return emitOpError("(C1) struct '")
           << type.getName() << "' has " << type.getFieldTypes().size()
           << " fields, but got " << getFields().size() << " operands";
  for (auto [name, expected, actual] : llvm::zip(
           type.getFieldNames(), type.getFieldTypes(), getFields().getTypes()))
    if (expected != actual)
      return emitOpError("(C1) field '") << name.getValue() << "' has type "
                                         << expected << ", but got " << actual;
  return success();
}

LogicalResult warp::verifyField(Operation *op, StructType type, StringRef field,
                                mlir::Type actual) {
  int64_t index = type.getFieldIndex(field);
  if (index < 0) {
    InFlightDiagnostic diagnostic = op->emitOpError("(C1) struct '");
    diagnostic << type.getName() << "' has no field '" << field << "'; it has ";
    llvm::interleaveComma(
        type.getFieldNames(), diagnostic,
        [&](StringAttr name) { diagnostic << "'" << name.getValue() << "'"; });
    return diagnostic;
  }
  if (type.getFieldTypes()[index] == actual)
    return success();
  return op->emitOpError("(C1) field '")
         << field << "' has type " << type.getFieldTypes()[index]
         << ", but got " << actual;
}

LogicalResult warp::StructGetOp::verify() {
  return verifyField(*this, cast<StructType>(getSource().getType()), getField(),
                     getResult().getType());
}

LogicalResult warp::StructSetOp::verify() {
  return verifyField(*this, cast<StructType>(getTarget().getType()), getField(),
                     getValue().getType());
}

//===----------------------------------------------------------------------===//
// Threads and output
//===----------------------------------------------------------------------===//

LogicalResult warp::CheckIndexOp::verify() {
  size_t count = getIndices().size();
  if (count >= 1 && count <= 4 && getExtents().size() == count)
    return success();
  return emitOpError(
             "(C1) expects 1 to 4 indices and as many extents, but got ")
         << count << " and " << getExtents().size();
}

LogicalResult warp::TidOp::verify() {
  if (getNumResults() >= 1 && getNumResults() <= 4)
    return success();
  return emitOpError("(C1) expects 1 to 4 results, but got ")
         << getNumResults();
}

/// Number of conversions in a printf format; `%%` is none.
static unsigned countConversions(StringRef format) {
  unsigned count = 0;
  for (size_t i = 0; i < format.size(); ++i) {
    if (format[i] != '%')
      continue;
    if (i + 1 < format.size() && format[i + 1] == '%')
      ++i;
    else
      ++count;
  }
  return count;
}

LogicalResult warp::PrintfOp::verify() {
  constexpr unsigned limit = 32;
  if (getArgs().size() > limit)
    return emitOpError("(C1) expects at most ")
           << limit << " operands, but got " << getArgs().size();
  unsigned conversions = countConversions(getFormat());
  if (conversions != getArgs().size())
    return emitOpError("(C2) the format has ")
           << conversions << " conversions, but there are " << getArgs().size()
           << " operands";
  return success();
}

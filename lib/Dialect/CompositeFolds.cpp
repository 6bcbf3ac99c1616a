//===- CompositeFolds.cpp - Simplification of composite accesses ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "WarpDialect/CompositeFolds.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/IR/Builders.h"
#include "mlir/IR/Matchers.h"
#include "llvm/ADT/APSInt.h"

using namespace mlir;

std::optional<int64_t> warp::getComponentPosition(mlir::Type composite,
                                                  ValueRange indices) {
  SmallVector<int64_t, 2> extents = warp::getIndexExtents(composite);
  if (indices.size() != extents.size())
    return std::nullopt;
  int64_t position = 0;
  for (auto [value, extent] : llvm::zip(indices, extents)) {
    APInt constant;
    if (!matchPattern(value, m_ConstantInt(&constant)))
      return std::nullopt;
    llvm::APSInt index(constant, value.getType().isUnsignedInteger());
    std::optional<int64_t> number = index.tryExtValue();
    if (!number || *number >= extent || *number < -extent)
      return std::nullopt;
    position = position * extent + (*number < 0 ? *number + extent : *number);
  }
  return position;
}

/// The operand that is component `position` of a constructed composite.
static OpFoldResult getComponent(warp::ConstructOp construct,
                                 int64_t position) {
  OperandRange parts = construct.getComponents();
  if (parts.empty()) {
    mlir::Type scalar = warp::getElementScalar(construct.getType());
    return cast<TypedAttr>(Builder(construct.getContext()).getZeroAttr(scalar));
  }
  if (parts.size() == 1 && warp::isScalar(parts[0].getType()))
    return parts[0];
  for (mlir::Value part : parts) {
    int64_t count = warp::getComponentCount(part.getType());
    if (position < count)
      return warp::isScalar(part.getType()) ? OpFoldResult(part)
                                            : OpFoldResult();
    position -= count;
  }
  return {};
}

/// Follows a chain of insertions to the one of this component, or to where none
/// of them has changed it, in one go: a matrix is many of them.
OpFoldResult warp::ExtractOp::fold(FoldAdaptor) {
  mlir::Type composite = getSource().getType();
  std::optional<int64_t> position =
      getComponentPosition(composite, getIndices());
  if (!position)
    return {};
  mlir::Value source = getSource();
  while (auto insert = source.getDefiningOp<InsertOp>()) {
    auto written = getComponentPosition(composite, insert.getIndices());
    if (!written)
      break;
    if (*written == *position)
      return insert.getValue();
    source = insert.getTarget();
  }
  if (auto construct = source.getDefiningOp<ConstructOp>())
    if (OpFoldResult component = getComponent(construct, *position))
      return component;
  if (source == getSource())
    return {};
  getSourceMutable().assign(source);
  return getResult();
}

OpFoldResult warp::PositionOp::fold(FoldAdaptor adaptor) {
  auto index = dyn_cast_or_null<IntegerAttr>(adaptor.getIndex());
  mlir::Type type = getType();
  if (!index || isa<IndexType>(type) || isa<IndexType>(index.getType()))
    return {};
  APInt number = index.getValue();
  int64_t place = index.getType().isUnsignedInteger() ? number.getZExtValue()
                                                      : number.getSExtValue();
  if (place < 0)
    place += getExtent();
  // One out of bounds stays for the report.
  if (place < 0 || place >= int64_t(getExtent()))
    return {};
  return IntegerAttr::get(type, place);
}

OpFoldResult warp::StructGetOp::fold(FoldAdaptor) {
  if (auto create = getSource().getDefiningOp<StructCreateOp>()) {
    auto type = cast<StructType>(create.getType());
    return create.getFields()[type.getFieldIndex(getField())];
  }
  auto set = getSource().getDefiningOp<StructSetOp>();
  if (!set)
    return {};
  if (set.getField() == getField())
    return set.getValue();
  getSourceMutable().assign(set.getTarget());
  return getResult();
}

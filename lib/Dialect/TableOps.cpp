//===- TableOps.cpp - Constant tables: verification and folds -------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A constant composite that is indexed at run time becomes a table here, so
// that no pass stores its components to memory of the thread.
//
//===----------------------------------------------------------------------===//

#include "TableFolds.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/IR/BuiltinAttributes.h"
#include "mlir/IR/Matchers.h"
#include "mlir/IR/PatternMatch.h"
#include "mlir/IR/TypeUtilities.h"

using namespace mlir;

LogicalResult warp::TableGetOp::verify() {
  ShapedType table = getTable().getType();
  if (!table.hasStaticShape() || table.getRank() == 0 ||
      table.getNumElements() == 0)
    return emitOpError("(C1) expects a table of at least one element, but got ")
           << table;
  if (getIndices().size() != size_t(table.getRank()))
    return emitOpError("(C1) expects ")
           << table.getRank() << " indices for " << table << ", but got "
           << getIndices().size();
  auto lanes = dyn_cast<VectorType>(getType());
  for (mlir::Type index : getIndices().getTypes())
    if (!isa<IntegerType>(getElementTypeOrSelf(index)) ||
        isa<VectorType>(index) != bool(lanes) ||
        (lanes && cast<VectorType>(index).getShape() != lanes.getShape()))
      return emitOpError("(C2) expects an integer as index")
             << (lanes ? " for each lane" : "") << ", but got " << index;
  if (getElementTypeOrSelf(getType()) != table.getElementType())
    return emitOpError("(C3) the table has elements of type ")
           << table.getElementType() << ", but the result has type "
           << getType();
  return success();
}

/// The place of an index along a dimension, as the operation defines it.
static int64_t toPosition(const APInt &index, mlir::Type type, int64_t extent) {
  int64_t place =
      type.isUnsignedInteger()
          ? int64_t(std::min<uint64_t>(index.getLimitedValue(), INT64_MAX))
          : index.getSExtValue();
  place += place < 0 ? extent : 0;
  return place < 0 || place >= extent ? extent - 1 : place;
}

/// Thread IR has other constants, so nothing is folded there; LLVM does it.
OpFoldResult warp::TableGetOp::fold(FoldAdaptor adaptor) {
  DenseElementsAttr table = getTable();
  if (getType() != table.getElementType() || !isScalar(getType()) ||
      llvm::any_of(getIndices().getTypes(),
                   [](mlir::Type type) { return type.isSignlessInteger(); }))
    return {};
  if (table.isSplat())
    return table.getSplatValue<TypedAttr>();
  int64_t position = 0;
  for (auto [index, value, extent] : llvm::zip_equal(
           adaptor.getIndices(), getIndices(), table.getType().getShape())) {
    auto number = dyn_cast_or_null<IntegerAttr>(index);
    if (!number)
      return {};
    position = position * extent +
               toPosition(number.getValue(), value.getType(), extent);
  }
  return cast<TypedAttr>(*(table.value_begin<Attribute>() + position));
}

//===----------------------------------------------------------------------===//
// Constant composites
//===----------------------------------------------------------------------===//

/// The components of a constant; nothing if one is not known.
static SmallVector<Attribute> getComponents(warp::ConstructOp construct) {
  SmallVector<Attribute> known;
  for (mlir::Value component : construct.getComponents()) {
    Attribute value;
    if (!matchPattern(component, m_Constant(&value)))
      return {};
    known.push_back(value);
  }
  // One operand fills all, so that no index makes a difference.
  int64_t count = warp::getComponentCount(construct.getType());
  return int64_t(known.size()) == count ? known : SmallVector<Attribute>();
}

/// True if an extraction is that of a component at an index of run time.
static bool isDynamic(Operation *op) {
  auto extract = dyn_cast<warp::ExtractOp>(op);
  return extract && llvm::any_of(extract.getIndices(), [](mlir::Value index) {
           return !matchPattern(index, m_Constant());
         });
}

/// An element of a long constant at an index of run time is read from a table;
/// a row is a vector of such elements.
static LogicalResult readTable(warp::ExtractOp op, PatternRewriter &rewriter) {
  using namespace warp;
  SmallVector<mlir::Value> indices(op.getIndices());
  mlir::Value source = op.getSource();
  // An element of a row.
  if (auto row = source.getDefiningOp<ExtractOp>();
      row && isa<MatType>(row.getSource().getType()) && isDynamic(op)) {
    source = row.getSource();
    indices.insert(indices.begin(), row.getIndices().begin(),
                   row.getIndices().end());
  }
  auto construct = source.getDefiningOp<ConstructOp>();
  if (!construct || !isLongComposite(source.getType()))
    return failure();
  bool isRow = isa<VecType>(op.getType());
  if (!isRow && llvm::all_of(indices, [](mlir::Value index) {
        return matchPattern(index, m_Constant());
      }))
    return failure();
  // Such users read the table themselves.
  if (isRow && llvm::any_of(op->getUsers(), isDynamic))
    return failure();
  SmallVector<Attribute> components = getComponents(construct);
  if (components.empty())
    return failure();
  mlir::Type element = getElementScalar(source.getType());
  auto table = DenseElementsAttr::get(
      RankedTensorType::get(getIndexExtents(source.getType()), element),
      components);
  auto get = [&](ArrayRef<mlir::Value> at) {
    auto made = TableGetOp::create(rewriter, op.getLoc(), element, table, at);
    // The index has its check already.
    made->setDiscardableAttrs(op->getDiscardableAttrDictionary());
    return made.getResult();
  };
  if (!isRow) {
    rewriter.replaceOp(op, get(indices));
    return success();
  }
  SmallVector<mlir::Value> elements;
  mlir::Type number = rewriter.getIntegerType(32, /*isSigned=*/true);
  for (int64_t i = 0; i < getComponentCount(op.getType()); ++i) {
    mlir::Value column = ConstantOp::create(rewriter, op.getLoc(),
                                            rewriter.getIntegerAttr(number, i));
    elements.push_back(get({indices[0], column}));
  }
  rewriter.replaceOpWithNewOp<ConstructOp>(op, op.getType(), elements);
  return success();
}

/// A component, at an index of run time, of a row that was read from a table is
/// an element of the table.
static LogicalResult readRow(warp::ExtractOp op, PatternRewriter &rewriter) {
  auto row = op.getSource().getDefiningOp<warp::ConstructOp>();
  auto type = dyn_cast<warp::VecType>(op.getSource().getType());
  if (!row || !type || row.getComponents().empty() || !isDynamic(op))
    return failure();
  auto first = row.getComponents()[0].getDefiningOp<warp::TableGetOp>();
  int64_t count = warp::getComponentCount(type);
  if (!first || first.getTable().getType().getShape().back() != count ||
      int64_t(row.getComponents().size()) != count)
    return failure();
  auto leading = first.getIndices().drop_back();
  for (auto [i, component] : llvm::enumerate(row.getComponents())) {
    auto get = component.getDefiningOp<warp::TableGetOp>();
    APInt column;
    if (!get || get.getTable() != first.getTable() ||
        !llvm::equal(get.getIndices().drop_back(), leading) ||
        !matchPattern(get.getIndices().back(), m_ConstantInt(&column)) ||
        column != i)
      return failure();
  }
  SmallVector<mlir::Value> indices(leading);
  indices.push_back(op.getIndices()[0]);
  auto made = rewriter.replaceOpWithNewOp<warp::TableGetOp>(
      op, op.getType(), first.getTable(), indices);
  made->setDiscardableAttrs(op->getDiscardableAttrDictionary());
  return success();
}

/// Elements of a table that is converted, which takes a microsecond each; a
/// table that is converted to a wider type has at most so many bytes.
static constexpr int64_t mostConverted = 16 << 10, mostWidenedBytes = 16 << 10;

/// A table whose elements are converted is one of the other type, so that each
/// number is rounded once, and not at run time.
static LogicalResult convertTable(warp::CastOp op, PatternRewriter &rewriter) {
  auto get = op.getSource().getDefiningOp<warp::TableGetOp>();
  mlir::Type to = op.getType();
  if (!get || !warp::isScalar(get.getType()) || !warp::isScalar(to))
    return failure();
  int64_t count = get.getTable().getNumElements();
  int64_t before = warp::getByteSize(get.getType());
  int64_t after = warp::getByteSize(to);
  if (count > mostConverted ||
      (after > before && count * after > mostWidenedBytes))
    return failure();
  SmallVector<Attribute> numbers = llvm::map_to_vector(
      get.getTable().getValues<Attribute>(), [&](Attribute number) {
        return warp::castConstant(number, get.getType(), to);
      });
  auto table = DenseElementsAttr::get(
      get.getTable().getType().cloneWith(std::nullopt, to), numbers);
  auto made = rewriter.replaceOpWithNewOp<warp::TableGetOp>(op, to, table,
                                                            get.getIndices());
  made->setDiscardableAttrs(get->getDiscardableAttrDictionary());
  return success();
}

void warp::addTablePatterns(RewritePatternSet &patterns) {
  patterns.add(readTable).add(readRow).add(convertTable);
}

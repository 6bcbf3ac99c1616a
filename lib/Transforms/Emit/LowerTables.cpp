//===- LowerTables.cpp - Constant tables: read-only global variables ------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A table is one constant global variable, however often it is read. The target
// says where it lies: NVIDIA's constant memory is as fast as a register if all
// lanes of a warp read one address, and takes a turn for each address if not.
// So a table lies there if all of its reads are uniform, and in read-only
// global memory otherwise. Lanes of a CPU gather, from short tables by selects.
//
//===----------------------------------------------------------------------===//

#include "ArrayLowering.h"

#include "Analysis/CostModel.h"
#include "Analysis/ThreadVariance.h"
#include "Targets/Target.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/IR/TypeUtilities.h"
#include "llvm/ADT/MapVector.h"

using namespace mlir;
using namespace warp;

/// A table as memory holds it: a boolean takes a byte.
static DenseElementsAttr storedTable(DenseElementsAttr table) {
  if (!isBool(table.getElementType()))
    return table;
  auto bytes = llvm::map_to_vector(table.getValues<bool>(),
                                   [](bool value) { return int8_t(value); });
  auto type = IntegerType::get(table.getContext(), 8);
  return DenseElementsAttr::get(
      RankedTensorType::get(table.getType().getShape(), type),
      ArrayRef<int8_t>(bytes));
}

/// A name that no other table of the module has.
std::string ArrayLowering::tableName() {
  size_t number = tables.size();
  std::string name;
  do
    name = "warp_table" + std::to_string(number++);
  while (isKept && module.lookupSymbol(name));
  return name;
}

void ArrayLowering::makeTables(ArrayRef<Operation *> operations) {
  llvm::MapVector<Attribute, SmallVector<TableGetOp>> reads;
  for (Operation *op : operations)
    if (auto get = dyn_cast<TableGetOp>(op))
      reads[get.getTable()].push_back(get);
  if (reads.empty())
    return;
  std::optional<ThreadVariance> variance;
  if (gpu)
    variance.emplace(cast<FunctionOpInterface>(entry.getOperation()));
  int64_t bytes = 0;
  for (auto &[attribute, users] : reads) {
    DenseElementsAttr table = storedTable(cast<DenseElementsAttr>(attribute));
    // Arguments of a function may be of the thread.
    bool isUniform =
        gpu && !isKept && llvm::all_of(users, [&](TableGetOp get) {
          return variance->isUniform(get.getIndices()[0], Scope::Lanes);
        });
    int64_t size = getByteSize(table.getElementType());
    bytes += isUniform ? table.getNumElements() * size : 0;
    unsigned space = target.getTableSpace(isUniform, bytes);
    OpBuilder::InsertionGuard guard(b);
    b.setInsertionPointToStart(module.getBody());
    auto type = LLVM::LLVMArrayType::get(table.getElementType(),
                                         table.getNumElements());
    auto global = LLVM::GlobalOp::create(
        b, users.front().getLoc(), type, /*isConstant=*/true,
        LLVM::Linkage::Internal, tableName(), table,
        /*alignment=*/std::max<int64_t>(16, size), space);
    tables[attribute] = global;
  }
}

/// The elements at the indices of lanes, chosen among all: each level halves
/// them by one bit of the index.
static mlir::Value selectLanes(OpBuilder &b, Location loc, TableGetOp op) {
  mlir::Value index = op.getIndices()[0];
  auto number = [&](int64_t value) {
    auto type = cast<VectorType>(index.getType());
    return arith::ConstantOp::create(
        b, loc,
        DenseElementsAttr::get(type,
                               b.getIntegerAttr(type.getElementType(), value)));
  };
  SmallVector<mlir::Value> left;
  for (Attribute element : op.getTable().getValues<Attribute>())
    left.push_back(arith::ConstantOp::create(
        b, loc,
        DenseElementsAttr::get(cast<VectorType>(op.getType()), element)));
  for (int64_t bit = 1; left.size() > 1; bit *= 2) {
    mlir::Value part = arith::AndIOp::create(b, loc, index, number(bit));
    mlir::Value isOdd = arith::CmpIOp::create(b, loc, arith::CmpIPredicate::ne,
                                              part, number(0));
    size_t half = (left.size() + 1) / 2;
    for (size_t i = 0; i < half; ++i)
      left[i] = 2 * i + 1 < left.size()
                    ? arith::SelectOp::create(b, loc, isOdd, left[2 * i + 1],
                                              left[2 * i])
                    : left[2 * i];
    left.resize(half);
  }
  return left.front();
}

void ArrayLowering::lowerTable(TableGetOp op) {
  if (isa<VectorType>(op.getType()) &&
      op.getTable().getNumElements() <= cost::selectedElements)
    return op.getResult().replaceAllUsesWith(selectLanes(b, loc, op));
  LLVM::GlobalOp global = tables.lookup(op.getTable());
  mlir::Type element =
      cast<LLVM::LLVMArrayType>(global.getType()).getElementType();
  auto space =
      LLVM::LLVMPointerType::get(b.getContext(), global.getAddrSpace());
  mlir::Value base =
      LLVM::AddressOfOp::create(b, loc, space, global.getSymName());
  mlir::Value index = op.getIndices()[0], value;
  int64_t alignment = getByteSize(element);
  if (auto lanes = dyn_cast<VectorType>(op.getType())) {
    int64_t count = lanes.getNumElements();
    mlir::Value places =
        LLVM::GEPOp::create(b, loc, LLVM::getVectorType(space, count), element,
                            base, ArrayRef<LLVM::GEPArg>(index));
    auto mask = DenseElementsAttr::get(VectorType::get(count, b.getI1Type()),
                                       b.getBoolAttr(true));
    value = LLVM::masked_gather::create(
        b, loc, VectorType::get(count, element), places,
        arith::ConstantOp::create(b, loc, mask), ValueRange(),
        b.getI32IntegerAttr(alignment));
  } else {
    mlir::Value place =
        LLVM::GEPOp::create(b, loc, space, element, base, widen(index, i64),
                            LLVM::GEPNoWrapFlags::inbounds);
    value = LLVM::LoadOp::create(b, loc, element, place, alignment,
                                 /*isVolatile=*/false, /*isNonTemporal=*/false,
                                 /*isInvariant=*/true);
  }
  if (value.getType() != op.getType())
    value = arith::TruncIOp::create(b, loc, op.getType(), value);
  op.getResult().replaceAllUsesWith(value);
}

//===- LowerTables.cpp - Constant tables: read-only global variables ------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A table is one constant global variable, however often it is read. The target
// says where it lies: NVIDIA's constant memory is as fast as a register if all
// lanes of a warp read one address, and takes a turn for each address if not.
// So a table lies there if all of its reads are uniform, and in read-only
// global memory otherwise.
//
//===----------------------------------------------------------------------===//

#include "ArrayLowering.h"

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
    bool isUniform =
        gpu && llvm::all_of(users, [&](TableGetOp get) {
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
        LLVM::Linkage::Internal, "warp_table" + std::to_string(tables.size()),
        table, /*alignment=*/std::max<int64_t>(16, size), space);
    tables[attribute] = global;
  }
}

void ArrayLowering::lowerTable(TableGetOp op) {
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

//===- LowerLaunch.h - Building the entry of a launch -----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// What warp-lower-launch knows while it builds an entry. LowerLaunch.cpp has
// what both targets share and the loops of the CPU, LowerLaunchGpu.cpp the
// thread of a GPU, LowerLaunchItems.cpp a GPU thread with several indices.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_LOWERLAUNCH_H
#define WARP_LIB_TRANSFORMS_LOWERLAUNCH_H

#include "KernelFunction.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/IR/Builders.h"

namespace warp {

constexpr auto noWrap =
    mlir::arith::IntegerOverflowFlags::nsw | mlir::arith::IntegerOverflowFlags::nuw;

/// Builds the entry around the body of one kernel.
class Launch {
public:
  Launch(mlir::FunctionOpInterface kernel)
      : kernel(kernel), loc(kernel.getLoc()), b(kernel->getContext()),
        rank(getVariant(kernel).getRank()),
        index32(getVariant(kernel).getIndex32()),
        flat(getVariant(kernel).getFlat()) {}

  llvm::LogicalResult build() {
    if (mlir::failed(collectArguments()))
      return mlir::failure();
    createEntry();
    readArguments();
    if (isGpu(kernel))
      buildGpu();
    else if (rank == 1)
      buildLoop();
    else
      buildRows();
    kernel->erase();
    return mlir::success();
  }

private:
  llvm::LogicalResult collectArguments();
  void createEntry();
  void readArguments();
  void buildLoop();
  void buildRows();
  void buildGpu();
  void buildOneItem(mlir::Block *first, mlir::Block *exit);
  void buildOneBlock(mlir::Block *first, mlir::Block *exit);
  void buildStream(mlir::Block *first, mlir::Block *exit, int64_t items);
  void buildPlanes(mlir::Block *first, mlir::Block *exit, int64_t items);
  void buildItems(mlir::Block *exit, int64_t items, mlir::Value lane,
                  mlir::Value step, mlir::Value end,
                  llvm::ArrayRef<mlir::Value> rest, mlir::Value allExist);
  int64_t chooseItems();
  mlir::Block *buildInnerLoop(mlir::Block *before, mlir::Value begin, mlir::Value end, mlir::Block *after,
                        llvm::ArrayRef<mlir::Value> outer);
  void inlineBody(mlir::ValueRange indices);
  void cloneInterleaved(llvm::ArrayRef<llvm::SmallVector<mlir::Value>> items,
                        mlir::Block *single, mlir::Value start,
                        mlir::Block *exit);
  llvm::SmallVector<mlir::Value> unravel(mlir::Value row, int count);
  llvm::SmallVector<mlir::Value> gridIndices(mlir::Value &inside);
  mlir::Value readSpecial(llvm::StringRef name, llvm::StringRef axis);
  mlir::Value gridIndex(llvm::StringRef axis, mlir::Type type);

  // Small arithmetic, in the order of operands.
  mlir::Value constant(mlir::Type type, int64_t value) {
    return mlir::arith::ConstantOp::create(b, loc, b.getIntegerAttr(type, value));
  }
  mlir::Value cmp(mlir::arith::CmpIPredicate predicate, mlir::Value x, mlir::Value y) {
    return mlir::arith::CmpIOp::create(b, loc, predicate, x, y);
  }
  mlir::Value add(mlir::Value x, mlir::Value y) {
    return mlir::arith::AddIOp::create(b, loc, x, y, noWrap);
  }
  mlir::Value sub(mlir::Value x, mlir::Value y) {
    return mlir::arith::SubIOp::create(b, loc, x, y, noWrap);
  }
  mlir::Value mul(mlir::Value x, mlir::Value y) {
    return mlir::arith::MulIOp::create(b, loc, x, y, noWrap);
  }
  mlir::Value div(mlir::Value x, mlir::Value y) { return mlir::arith::DivUIOp::create(b, loc, x, y); }
  mlir::Value narrow(mlir::Value x, mlir::Type type) {
    unsigned from = x.getType().getIntOrFloatBitWidth();
    unsigned to = type.getIntOrFloatBitWidth();
    if (from == to)
      return x;
    if (from < to)
      return mlir::arith::ExtUIOp::create(b, loc, type, x);
    return mlir::arith::TruncIOp::create(b, loc, type, x, noWrap);
  }
  mlir::Value parameter(mlir::Type type, int64_t offset) {
    return ParameterOp::create(b, loc, type, block, offset,
                                     /*packed=*/false, mlir::StringAttr());
  }

  mlir::FunctionOpInterface kernel;
  mlir::Location loc;
  mlir::OpBuilder b;
  int64_t rank;
  bool index32, flat;
  llvm::SmallVector<mlir::Type> argTypes;
  mlir::LLVM::LLVMFuncOp entry;
  mlir::Value block;
  /// Extents of the launch, i32.
  llvm::SmallVector<mlir::Value> dims;
  /// What the body's arguments become.
  llvm::SmallVector<mlir::Value> arguments;
};

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_LOWERLAUNCH_H

//===- GridReads.cpp - Reads of grid and thread indices -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "GridReads.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/GPU/IR/GPUDialect.h"

using namespace mlir;

static warp::Axis toAxis(gpu::Dimension dimension) {
  switch (dimension) {
  case gpu::Dimension::x:
    return warp::Axis::x;
  case gpu::Dimension::y:
    return warp::Axis::y;
  case gpu::Dimension::z:
    return warp::Axis::z;
  }
  llvm_unreachable("no such dimension");
}

std::optional<warp::GridRead> warp::getGridRead(Value value) {
  auto cast = value.getDefiningOp<arith::IndexCastOp>();
  Operation *op = (cast ? cast.getIn() : value).getDefiningOp();
  if (auto read = dyn_cast_or_null<gpu::ThreadIdOp>(op))
    return GridRead{GridValue::threadId, toAxis(read.getDimension())};
  if (auto read = dyn_cast_or_null<gpu::BlockIdOp>(op))
    return GridRead{GridValue::blockId, toAxis(read.getDimension())};
  if (auto read = dyn_cast_or_null<gpu::BlockDimOp>(op))
    return GridRead{GridValue::blockDim, toAxis(read.getDimension())};
  if (auto read = dyn_cast_or_null<gpu::GridDimOp>(op))
    return GridRead{GridValue::gridDim, toAxis(read.getDimension())};
  if (isa_and_nonnull<gpu::LaneIdOp>(op))
    return GridRead{GridValue::laneId, Axis::x};
  return std::nullopt;
}

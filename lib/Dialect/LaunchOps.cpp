//===- LaunchOps.cpp - Verification of WarpLaunchOps.td -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "WarpDialect/WarpOps.h"

using namespace mlir;

LogicalResult warp::ParameterOp::verify() {
  // (C1)
  if (static_cast<int64_t>(getOffset()) < 0)
    return emitOpError("expects an offset of 0 or more, but got ")
           << static_cast<int64_t>(getOffset());
  // (C2)
  if (getPacked() && !isa<warp::ArrayType>(getResult().getType()))
    return emitOpError("expects an array to be packed, but got ")
           << getResult().getType();
  return success();
}

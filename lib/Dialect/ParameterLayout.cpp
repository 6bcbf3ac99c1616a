//===- ParameterLayout.cpp - Layout of kernel parameter blocks ------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "WarpDialect/ParameterLayout.h"

#include "WarpDialect/WarpTypes.h"
#include "warp/Launch.h"

#include "mlir/IR/TypeRange.h"
#include "llvm/Support/MathExtras.h"

using namespace mlir;

void warp::collectLeaves(Type type, int64_t offset,
                         SmallVectorImpl<Leaf> &leaves) {
  if (auto record = dyn_cast<StructType>(type)) {
    for (auto [i, field] : llvm::enumerate(record.getFieldTypes()))
      collectLeaves(field, offset + getFieldOffset(record, i), leaves);
    return;
  }
  if (!isComposite(type)) {
    leaves.push_back({type, offset});
    return;
  }
  Type scalar = getElementScalar(type);
  int64_t size = getByteSize(scalar);
  for (int64_t i = 0, n = getComponentCount(type); i < n; ++i)
    leaves.push_back({scalar, offset + i * size});
}

warp::ParameterLayout warp::layOutParameters(TypeRange arguments) {
  ParameterLayout layout;
  int64_t end = firstArgument;
  for (Type type : arguments) {
    end = llvm::alignTo(end, getByteAlign(type));
    layout.offsets.push_back(end);
    end += getByteSize(type);
  }
  layout.size = llvm::alignTo(end, 8);
  return layout;
}

//===- ParameterLayout.h - Layout of kernel parameter blocks ----*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The parameter block starts with the `LaunchHeader` of warp/Launch.h; the
// arguments follow at their natural alignment, in C layout.
//
//===----------------------------------------------------------------------===//

#ifndef WARPDIALECT_PARAMETERLAYOUT_H
#define WARPDIALECT_PARAMETERLAYOUT_H

#include "mlir/IR/BuiltinTypes.h"

namespace warp {

/// A scalar or array somewhere in a value, as `flatten` orders them.
struct Leaf {
  mlir::Type type;
  int64_t offset;
};

/// Appends the scalars and arrays of a value that lies at `offset`.
void collectLeaves(mlir::Type type, int64_t offset,
                   llvm::SmallVectorImpl<Leaf> &leaves);

struct ParameterLayout {
  /// Byte offset of each argument.
  llvm::SmallVector<int64_t> offsets;
  /// Bytes of the whole block.
  int64_t size = 0;
};

ParameterLayout layOutParameters(mlir::TypeRange arguments);

} // namespace warp

#endif // WARPDIALECT_PARAMETERLAYOUT_H

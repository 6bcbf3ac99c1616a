//===- HiddenArguments.h - Arguments that derivatives add -------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_HIDDENARGUMENTS_H
#define WARP_TRANSFORMS_AUTODIFF_HIDDENARGUMENTS_H

#include "WarpDialect/WarpAttributes.h"

#include "mlir/IR/Value.h"
#include "mlir/Interfaces/FunctionInterfaces.h"

namespace warp::autodiff {

/// Appends an argument that the primal does not have.
mlir::BlockArgument addHidden(mlir::FunctionOpInterface function,
                              HiddenAttr hidden, mlir::Type type);

/// What such an argument is; null for any other.
HiddenAttr getHidden(mlir::BlockArgument argument);

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_HIDDENARGUMENTS_H

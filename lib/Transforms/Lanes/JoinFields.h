//===- JoinFields.h - Fields of an element in one load ----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_JOINFIELDS_H
#define WARP_LIB_TRANSFORMS_JOINFIELDS_H

#include "mlir/Interfaces/FunctionInterfaces.h"

namespace warp {

/// Loads fields of one element together, if they are a good part of it.
void joinFields(mlir::FunctionOpInterface kernel);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_JOINFIELDS_H

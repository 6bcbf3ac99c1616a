//===- CopiedArrays.h - Privatization of updated arrays ---------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_COPIEDARRAYS_H
#define WARP_LIB_TRANSFORMS_COPIEDARRAYS_H

#include "UpdateCosts.h"
#include "WarpDialect/WarpAttributes.h"
#include "warp/PrivateCopies.h"

#include "mlir/Interfaces/FunctionInterfaces.h"

namespace warp {

/// Lists in the schedule the arrays whose copies would spare atomic
/// instructions, if those would spare all; whether there are any.
bool offerCopies(mlir::FunctionOpInterface kernel, const UpdateCosts &costs);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_COPIEDARRAYS_H

//===- AccessRegions.h - Access regions of a kernel's arrays ----*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_ANALYSIS_ACCESSREGIONS_H
#define WARP_LIB_ANALYSIS_ACCESSREGIONS_H

#include "warp/Regions.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"

namespace warp {

/// The elements that the accesses of a kernel name, as a formula in what is
/// known at a launch. Takes warp IR; what other functions of the module do to
/// an array makes all of it unknown.
RegionFormula findAccessRegions(mlir::func::FuncOp kernel);

} // namespace warp

#endif // WARP_LIB_ANALYSIS_ACCESSREGIONS_H

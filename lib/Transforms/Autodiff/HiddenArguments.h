//===- HiddenArguments.h - Arguments that derivatives add -------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_HIDDENARGUMENTS_H
#define WARP_TRANSFORMS_AUTODIFF_HIDDENARGUMENTS_H

#include "WarpDialect/WarpAttributes.h"

#include "mlir/IR/Builders.h"
#include "mlir/IR/Value.h"
#include "mlir/Interfaces/FunctionInterfaces.h"

namespace warp::attr {
/// On an adjoint, until warp-clean-up-adjoint: places of its counters.
constexpr llvm::StringLiteral places = "warp.places";
} // namespace warp::attr

namespace warp::autodiff {

/// Appends an argument that the primal does not have.
mlir::BlockArgument addHidden(mlir::FunctionOpInterface function,
                              HiddenAttr hidden, mlir::Type type);

/// One more in the counter of this line if the condition holds; counters are in
/// the order of `places`.
void countOne(mlir::OpBuilder &builder, mlir::Location loc,
              mlir::Value condition, mlir::Value counters,
              llvm::SmallVectorImpl<mlir::Location> &places);

/// The place in the source: "file:line:column".
std::string describePlace(mlir::Location loc);

/// Leaves the places of counters at a derivative.
void attachPlaces(mlir::FunctionOpInterface derivative,
                  llvm::ArrayRef<mlir::Location> places);

/// The meaning of such an argument; null for any other.
HiddenAttr getHidden(mlir::BlockArgument argument);

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_HIDDENARGUMENTS_H

//===- DerivativeOps.cpp - Verification of WarpDerivativeOps.td -----------===//

#include "WarpDialect/Passes.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"

using namespace mlir;

/// The types among these that have cotangents.
static SmallVector<Type> differentiable(TypeRange types) {
  return llvm::filter_to_vector(types, [](Type type) {
    Type scalar = warp::getElementScalar(type);
    return scalar && warp::isFloat(scalar);
  });
}

LogicalResult
warp::VjpOp::verifySymbolUses(SymbolTableCollection &symbols) {
  auto callee = symbols.lookupNearestSymbolFrom<func::FuncOp>(
      *this, getCalleeAttr());
  if (!callee)
    return emitOpError("(C1) expects a function, but got '")
           << getCallee() << "'";
  if (getArguments().getTypes() != TypeRange(callee.getArgumentTypes()))
    return emitOpError("(C1) expects arguments of types (")
           << callee.getArgumentTypes() << "), but got ("
           << getArguments().getTypes() << ")";
  auto residuals = callee->getAttrOfType<IntegerAttr>(attr::residuals);
  TypeRange results = callee.getResultTypes();
  if (residuals)
    results = results.drop_back(residuals.getInt());
  SmallVector<Type> seeds = differentiable(results);
  if (getCotangents().getTypes() != TypeRange(seeds))
    return emitOpError("(C2) expects cotangents of types (")
           << seeds << "), but got (" << getCotangents().getTypes() << ")";
  SmallVector<Type> adjoints = differentiable(callee.getArgumentTypes());
  if (getResultTypes() != TypeRange(adjoints))
    return emitOpError("(C3) expects results of types (")
           << adjoints << "), but got (" << getResultTypes() << ")";
  return success();
}

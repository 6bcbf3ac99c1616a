//===- DerivativeOps.cpp - Verification of WarpDerivativeOps.td -----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

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

/// (C1) The function that an operation names, if its arguments are right.
static func::FuncOp findCallee(Operation *op, FlatSymbolRefAttr symbol,
                               OperandRange arguments,
                               SymbolTableCollection &symbols) {
  auto callee = symbols.lookupNearestSymbolFrom<func::FuncOp>(op, symbol);
  if (!callee) {
    op->emitOpError("(C1) expects a function, but got '")
        << symbol.getValue() << "'";
    return nullptr;
  }
  if (arguments.getTypes() == TypeRange(callee.getArgumentTypes()))
    return callee;
  op->emitOpError("(C1) expects arguments of types (")
      << callee.getArgumentTypes() << "), but got (" << arguments.getTypes()
      << ")";
  return nullptr;
}

static LogicalResult verifyTypes(Operation *op, StringRef what,
                                 TypeRange expected, TypeRange actual) {
  if (actual == expected)
    return success();
  return op->emitOpError() << what << " of types (" << expected
                           << "), but got (" << actual << ")";
}

/// Types of the results that are for the caller.
static TypeRange ownResults(func::FuncOp callee) {
  TypeRange results = callee.getResultTypes();
  auto count = callee->getAttrOfType<IntegerAttr>(warp::attr::residuals);
  return count ? results.drop_back(count.getInt()) : results;
}

LogicalResult warp::VjpOp::verifySymbolUses(SymbolTableCollection &symbols) {
  func::FuncOp callee =
      findCallee(*this, getCalleeAttr(), getArguments(), symbols);
  if (!callee ||
      failed(verifyTypes(*this, "(C2) expects cotangents",
                         differentiable(ownResults(callee)),
                         getCotangents().getTypes())))
    return failure();
  return verifyTypes(*this, "(C3) expects results",
                     differentiable(callee.getArgumentTypes()),
                     getResultTypes());
}

LogicalResult warp::JvpOp::verifySymbolUses(SymbolTableCollection &symbols) {
  func::FuncOp callee =
      findCallee(*this, getCalleeAttr(), getArguments(), symbols);
  if (!callee)
    return failure();
  SmallVector<Type> possible = differentiable(callee.getArgumentTypes());
  ArrayRef<Type> wanted =
      ArrayRef(possible).take_front(getTangents().size());
  if (failed(verifyTypes(*this, "(C2) expects tangents", wanted,
                         getTangents().getTypes())))
    return failure();
  return verifyTypes(*this, "(C3) expects results",
                     differentiable(ownResults(callee)), getResultTypes());
}

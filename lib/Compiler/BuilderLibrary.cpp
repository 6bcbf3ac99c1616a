//===- BuilderLibrary.cpp - Calls of the device library -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "BuilderImpl.h"

#include "WarpDialect/LibraryOps.h"

using namespace mlir;

warp::Value warp::Builder::arrayAt(Value address, const Values &extents,
                                   Type element) {
  ContextLock lock;
  mlir::Type type = ArrayType::get(impl->builder.getContext(),
                                   int64_t(extents.size()), unwrap(element));
  return wrap(ArrayAtOp::create(impl->builder, impl->loc, type, unwrap(address),
                                unwrap(extents))
                  .getResult());
}

warp::Builder::Values warp::Builder::libraryCall(const std::string &symbol,
                                                 const Values &args) {
  ContextLock lock;
  const LibraryFunction *function = findLibraryFunction(symbol);
  if (!function)
    impl->failType("the device library has no function '" + symbol + "'");
  SmallVector<mlir::Type> results;
  for (char letter : function->results)
    results.push_back(getLibraryType(impl->builder.getContext(), letter));
  auto call = LibraryCallOp::create(impl->builder, impl->loc, results, symbol,
                                    unwrap(args));
  return wrap(ValueRange(call.getResults()));
}

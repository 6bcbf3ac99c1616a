//===- BuilderLibrary.cpp - Calls of the device library -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "BuilderLibrary.h"

#include "WarpDialect/LibraryOps.h"

using namespace mlir;

/// `_array_at(address, like, extents...)`: elements are as `like` is.
static SmallVector<mlir::Value> arrayAt(warp::Builder::Impl &impl,
                                        ValueRange args) {
  if (args.size() < 3)
    impl.failType("'_array_at' expects an address, an element and extents");
  ValueRange extents = args.drop_front(2);
  mlir::Type type =
      warp::ArrayType::get(impl.builder.getContext(), int64_t(extents.size()),
                           args[1].getType());
  return {warp::ArrayAtOp::create(
      impl.builder, impl.loc, type, args[0], extents,
      impl.builder.getI64IntegerAttr(warp::getByteSize(args[1].getType())))};
}

std::optional<SmallVector<mlir::Value>>
warp::buildLibraryCall(Builder::Impl &impl, StringRef name, ValueRange args) {
  if (name == "_array_at")
    return arrayAt(impl, args);
  if (!name.consume_front("_"))
    return std::nullopt;
  const LibraryFunction *function = findLibraryFunction(name);
  if (!function)
    return std::nullopt;
  SmallVector<mlir::Type> results;
  for (char letter : function->results)
    results.push_back(getLibraryType(impl.builder.getContext(), letter));
  if (args.size() != function->operands.size())
    impl.failType("'" + name.str() + "' expects " +
                  std::to_string(function->operands.size()) + " arguments");
  for (auto [arg, letter] : llvm::zip(args, function->operands)) {
    mlir::Type wanted = getLibraryType(impl.builder.getContext(), letter);
    if (arg.getType() != wanted)
      impl.failType("'" + name.str() + "' expects " + quoted(wanted) +
                    ", but got " + quoted(arg.getType()));
  }
  auto call =
      LibraryCallOp::create(impl.builder, impl.loc, results, name, args);
  return SmallVector<mlir::Value>(call.getResults());
}

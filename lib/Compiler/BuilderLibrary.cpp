//===- BuilderLibrary.cpp - Calls of the device library -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "BuilderLibrary.h"

#include "WarpDialect/LibraryOps.h"
#include "warp/NativeCode.h"

#include "mlir/AsmParser/AsmParser.h"

using namespace mlir;

std::optional<SmallVector<mlir::Value>>
warp::buildLibraryCall(Builder::Impl &impl, StringRef name, ValueRange args) {
  if (!name.consume_front("_"))
    return std::nullopt;
  if (name.starts_with(nativeCodePrefix)) {
    // The types of the results follow the symbol.
    auto [symbol, list] = name.split(':');
    SmallVector<StringRef> texts;
    list.split(texts, ',');
    SmallVector<mlir::Type> results;
    for (StringRef text : texts)
      results.push_back(mlir::parseType(text, impl.builder.getContext()));
    auto call =
        LibraryCallOp::create(impl.builder, impl.loc, results, symbol, args);
    return SmallVector<mlir::Value>(call.getResults());
  }
  const LibraryFunction *function = findLibraryFunction(name);
  // Effects on memory are for passes alone.
  if (!function || function->results.empty())
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

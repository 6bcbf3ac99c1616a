//===- HiddenArguments.cpp - Arguments that derivatives add ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "HiddenArguments.h"

#include "WarpDialect/Passes.h"

using namespace mlir;

BlockArgument warp::autodiff::addHidden(FunctionOpInterface function,
                                        HiddenAttr hidden, Type type) {
  Builder b(function.getContext());
  unsigned number = function.getNumArguments();
  (void)function.insertArgument(
      number, type, b.getDictionaryAttr(b.getNamedAttr(attr::hidden, hidden)),
      function.getLoc());
  return function.getArgument(number);
}

warp::HiddenAttr warp::autodiff::getHidden(BlockArgument argument) {
  auto function =
      cast<FunctionOpInterface>(argument.getOwner()->getParentOp());
  return function.getArgAttrOfType<HiddenAttr>(argument.getArgNumber(),
                                               attr::hidden);
}

//===- HiddenArguments.cpp - Arguments that derivatives add ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "HiddenArguments.h"

#include "WarpDialect/Passes.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/SCF/IR/SCF.h"

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
  auto function = cast<FunctionOpInterface>(argument.getOwner()->getParentOp());
  return function.getArgAttrOfType<HiddenAttr>(argument.getArgNumber(),
                                               attr::hidden);
}

std::string warp::autodiff::describePlace(Location loc) {
  std::string text;
  llvm::raw_string_ostream stream(text);
  if (auto place = loc->findInstanceOf<FileLineColLoc>())
    stream << place.getFilename().getValue() << ':' << place.getLine() << ':'
           << place.getColumn();
  else
    stream << "an unknown place";
  return text;
}

void warp::autodiff::attachPlaces(FunctionOpInterface derivative,
                                  ArrayRef<Location> list) {
  SmallVector<std::string> places = llvm::map_to_vector(list, describePlace);
  SmallVector<StringRef> texts(places.begin(), places.end());
  if (!places.empty())
    derivative->setAttr(
        warp::attr::places,
        Builder(derivative.getContext()).getStrArrayAttr(texts));
}

void warp::autodiff::countOne(OpBuilder &builder, Location loc, Value condition,
                              Value counters,
                              SmallVectorImpl<Location> &places) {
  auto found = llvm::find(places, loc);
  int64_t line = found - places.begin();
  if (found == places.end())
    places.push_back(loc);
  Type type = builder.getIntegerType(32, true);
  auto branch = scf::IfOp::create(builder, loc, condition, false);
  OpBuilder::InsertionGuard guard(builder);
  builder.setInsertionPointToStart(branch.thenBlock());
  auto constant = [&](int64_t value) -> Value {
    return ConstantOp::create(builder, loc,
                              builder.getIntegerAttr(type, value));
  };
  AtomicOp::create(builder, loc, type, AtomicKind::add, constant(1), counters,
                   ValueRange(constant(line)));
}

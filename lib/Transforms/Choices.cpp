//===- Choices.cpp - Notes of scheduling decisions -----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Choices.h"

#include "warp/Compile.h"

#include "mlir/IR/Builders.h"

using namespace mlir;

/// The source line of an operation, 0 if it is not known.
static int64_t getLine(Operation *op) {
  FileLineColLoc place;
  if (op)
    op->getLoc()->walk([&](Location part) {
      place = dyn_cast<FileLineColLoc>(part);
      return place ? WalkResult::interrupt() : WalkResult::advance();
    });
  return place ? place.getLine() : 0;
}

void warp::noteChoice(Operation *function, StringRef what, const Twine &value,
                      const Twine &reason, Operation *place) {
  mlir::Builder b(function->getContext());
  SmallVector<Attribute> notes;
  if (auto before = function->getAttrOfType<ArrayAttr>(attr::choices))
    llvm::append_range(notes, before);
  notes.push_back(b.getArrayAttr({b.getStringAttr(what), b.getStringAttr(value),
                                  b.getStringAttr(reason),
                                  b.getI64IntegerAttr(getLine(place))}));
  function->setAttr(attr::choices, b.getArrayAttr(notes));
}

std::vector<warp::Choice> warp::readChoices(Operation *function) {
  std::vector<Choice> choices;
  if (auto notes = function->getAttrOfType<ArrayAttr>(attr::choices))
    for (auto note : notes.getAsRange<ArrayAttr>())
      choices.push_back({cast<StringAttr>(note[0]).str(),
                         cast<StringAttr>(note[1]).str(),
                         cast<StringAttr>(note[2]).str(),
                         int(cast<IntegerAttr>(note[3]).getInt())});
  return choices;
}

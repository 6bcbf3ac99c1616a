//===- LocalReads.cpp - Copy avoidance: reads of the newest value ---------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Canonicalisation reads a component that an insertion leaves alone from the
// value before the insertion:
//
//   b = insert x, a[0]; y = extract a[1]; c = insert y + 1, b[1]
//
// In registers that costs nothing. In memory `a` is needed after `b` is made,
// so both would have a copy of their own. Here `y` is extracted from `b` again,
// if nothing else needs `a` by then.
//
//===----------------------------------------------------------------------===//

#include "PlaceLocals.h"

#include "LocalWebs.h"
#include "WarpDialect/CompositeFolds.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Interfaces/FunctionInterfaces.h"

using namespace mlir;

/// Uses that are looked at in a function: a component that many insertions
/// leave alone is moved by each of them.
constexpr size_t mostVisited = 1 << 16;

/// Moves the extractions behind an insertion that it leaves alone, if these are
/// all uses of the old value there.
static void readFrom(warp::InsertOp insert, size_t &visited) {
  Value old = insert.getTarget();
  Type type = old.getType();
  auto written = warp::getComponentPosition(type, insert.getIndices());
  if (!written)
    return;
  SmallVector<OpOperand *> reads;
  for (OpOperand &use : old.getUses()) {
    ++visited;
    Operation *here =
        insert->getBlock()->findAncestorOpInBlock(*use.getOwner());
    if (!here || !insert->isBeforeInBlock(here))
      continue;
    auto extract = dyn_cast<warp::ExtractOp>(use.getOwner());
    auto read = extract ? warp::getComponentPosition(type, extract.getIndices())
                        : std::nullopt;
    if (!read || *read == *written)
      return;
    reads.push_back(&use);
  }
  for (OpOperand *use : reads)
    use->set(insert.getResult());
}

void warp::readNewest(FunctionOpInterface function) {
  size_t visited = 0;
  function.walk([&](warp::InsertOp insert) {
    if (visited < mostVisited &&
        warp::isLongComposite(insert.getResult().getType()))
      readFrom(insert, visited);
  });
}

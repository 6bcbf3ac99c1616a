//===- MapToGrid.cpp - One launch index per GPU thread --------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The default mapping. The last dimension of the launch is axis x of the grid,
// so that neighbouring threads access neighbouring memory; the one before it
// is axis y, those before are axis z together. A guard excludes threads that
// the launch does not have. A launch that does not fit the axes is `flat`: one
// 64-bit linear index on axis x.
//
//===----------------------------------------------------------------------===//

#include "GridMapping.h"

#include "WarpDialect/TilePasses.h"

using namespace mlir;
using namespace warp;

namespace {

class MapToGrid : public GridMapping {
public:
  using GridMapping::GridMapping;

  bool applies() override { return true; }
  Description describe(bool) override {
    if (site.function->hasAttr(attr::blockThreads))
      return {"coarsening", "1", "the threads of a block share tiles"};
    return {"coarsening", "1",
            site.whyNotMapping.empty() ? "threads would share no loads"
                                       : site.whyNotMapping};
  }
  bool hasIndependentBlocks() const override { return true; }

private:
  Values build() override;
  Values gridIndices(Value &inside);
};

} // namespace

/// Thread indices, and a condition that the launch has that thread.
MapToGrid::Values MapToGrid::gridIndices(Value &inside) {
  Type i64 = b.getI64Type();
  Type type = index32 ? b.getI32Type() : i64;
  auto guard = [&](Value index, Value extent) {
    Value fits = isLess(index, narrow(extent, index.getType()));
    inside = inside ? both(inside, fits) : fits;
  };
  if (site.function->hasAttr(attr::ragged)) {
    // Threads beyond the launch take part in the work of their block
    // (warp-mask-threads).
    Value last = sub(countAll(), constant(i64, 1));
    Value linear =
        arith::MinSIOp::create(b, loc, gridIndex(Axis::x, i64), last);
    return unravel(linear, rank);
  }
  if (rank > 1 && site.function->hasAttr(attr::blockThreads)) {
    // A block that works on tiles is one row of the last dimension.
    Value row = narrow(read(GridValue::blockId), type);
    Value rows = narrow(dims[0], type);
    for (Value extent : ArrayRef(dims).drop_front().drop_back())
      rows = mul(rows, narrow(extent, type));
    guard(row, rows);
    Values indices = unravel(row, rank - 1);
    indices.push_back(narrow(read(GridValue::threadId), type));
    return indices;
  }
  if (flat) {
    Value linear = gridIndex(Axis::x, i64);
    guard(linear, countAll());
    return unravel(linear, rank);
  }
  Values indices(rank);
  indices[rank - 1] = gridIndex(Axis::x, type);
  guard(indices[rank - 1], dims[rank - 1]);
  if (rank > 1) {
    indices[rank - 2] = gridIndex(Axis::y, type);
    guard(indices[rank - 2], dims[rank - 2]);
  }
  if (rank > 2) {
    Value slab = gridIndex(Axis::z, type);
    Value extent = narrow(dims[0], type);
    if (rank == 4)
      extent = mul(extent, narrow(dims[1], type));
    guard(slab, extent);
    llvm::copy(unravel(slab, rank - 2), indices.begin());
  }
  return indices;
}

MapToGrid::Values MapToGrid::build() {
  Value inside;
  Values indices = gridIndices(inside);
  if (!inside)
    inside = constant(b.getI1Type(), 1);
  Values sums = identities(/*inLanes=*/false);
  auto branch = scf::IfOp::create(b, loc, TypeRange(ValueRange(sums)), inside,
                                  /*withElseRegion=*/!sums.empty());
  b.setInsertionPointToStart(branch.thenBlock());
  Values terms = takeThread(indices);
  if (!sums.empty()) {
    scf::YieldOp::create(b, loc, terms);
    b.setInsertionPointToStart(branch.elseBlock());
    scf::YieldOp::create(b, loc, sums);
  }
  return Values(branch.getResults());
}

WARP_MAKE_SCHEDULE(MapToGrid)

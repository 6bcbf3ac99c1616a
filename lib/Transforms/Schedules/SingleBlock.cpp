//===- SingleBlock.cpp - One block for the whole launch -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// For deterministic launches whose result depends on the order of updates.
// The threads of the only block loop over all indices, so that which thread
// runs which index does not depend on the device:
//
//   for n = thread to extent step blockDim: body(n)
//
// warp-plan-updates has asked for it (`single_block`).
//
//===----------------------------------------------------------------------===//

#include "GridMapping.h"

using namespace mlir;
using namespace warp;

namespace {

class SingleBlock : public GridMapping {
public:
  using GridMapping::GridMapping;

  bool applies() override { return countThreads() != 0; }
  Description describe(bool) override {
    return {"single_block", std::to_string(countThreads()),
            "sums are made in one order"};
  }

private:
  int64_t countThreads() { return getSchedule(site.function).getSingleBlock(); }
  Values build() override;
};

} // namespace

SingleBlock::Values SingleBlock::build() {
  Type i64 = b.getI64Type();
  Value begin = narrow(read(GridValue::threadId), i64);
  Value step = narrow(read(GridValue::blockDim), i64);
  Values sums = identities(/*inLanes=*/false);
  auto loop = scf::ForOp::create(b, loc, begin, countAll(), step, sums);
  b.setInsertionPointToStart(loop.getBody());
  Values terms = takeThread(unravel(loop.getInductionVar(), rank));
  Values next = combine(loop.getRegionIterArgs(), terms);
  if (!sums.empty())
    scf::YieldOp::create(b, loc, next);
  return Values(loop.getResults());
}

WARP_MAKE_SCHEDULE(SingleBlock)

//===- WarpAttributes.cpp - What is known of a launch ---------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "WarpDialect/WarpAttributes.h"

#include "WarpDialect/WarpDialect.h"

#include "mlir/IR/Builders.h"
#include "mlir/IR/DialectImplementation.h"

#include "llvm/ADT/TypeSwitch.h"

using namespace mlir;

#define GET_ATTRDEF_CLASSES
#include "WarpDialect/WarpAttributes.cpp.inc"

void warp::WarpDialect::registerAttributes() {
  addAttributes<
#define GET_ATTRDEF_LIST
#include "WarpDialect/WarpAttributes.cpp.inc"
      >();
}

//===----------------------------------------------------------------------===//
// Target
//===----------------------------------------------------------------------===//

using EmitError = function_ref<InFlightDiagnostic()>;

LogicalResult warp::TargetAttr::verify(EmitError emitError, Platform platform,
                                       int64_t version, StringRef processor,
                                       int64_t bits) {
  if (platform == Platform::cuda) {
    std::string own = "sm_" + std::to_string(version) + "a";
    if (version > 0 && bits == 0 && (processor.empty() || processor == own))
      return success();
    return emitError() << "(C1) expects a GPU with a version and no vectors";
  }
  if (version != 0)
    return emitError() << "(C2) expects a CPU without a version, but got "
                       << version;
  if (bits != 128 && bits != 256 && bits != 512)
    return emitError() << "(C2) expects vectors of 128, 256 or 512 bits, but "
                          "got "
                       << bits;
  return success();
}

bool warp::TargetAttr::has(Feature feature) const {
  switch (feature) {
  case Feature::PairedFloatUpdates:
    return isGpu() && getVersion() >= 90;
  }
  llvm_unreachable("unknown feature");
}

int64_t warp::TargetAttr::getLanes(Type type) const {
  if (isGpu())
    return 1;
  // Booleans are computed with as bytes.
  int64_t width = std::max(8u, type.getIntOrFloatBitWidth());
  return std::max<int64_t>(1, getBits() / width);
}

//===----------------------------------------------------------------------===//
// Variant
//===----------------------------------------------------------------------===//

LogicalResult warp::VariantAttr::verify(EmitError emitError, TargetAttr,
                                        int64_t rank, uint64_t, bool, bool,
                                        bool, bool, bool, int64_t coarsening,
                                        bool, int64_t block, int64_t threads,
                                        int64_t, int64_t lanes, int64_t inner,
                                        bool, bool, Determinism) {
  if (rank < 1 || rank > 4)
    return emitError() << "(C1) expects a launch of 1 to 4 dimensions, but got "
                       << rank;
  if (block < 1 || threads < 1)
    return emitError() << "(C2) expects 1 thread or more, but got "
                       << std::min(block, threads);
  for (auto [number, what] : {std::pair(lanes, "lanes"), {inner, "in a row"}})
    if (number < 0 || number > 64 ||
        (number > 0 && !llvm::isPowerOf2_64(number)))
      return emitError() << "(C3) expects 1 to 64 " << what
                         << ", a power of two, or 0, but got " << number;
  if (coarsening != 1 && coarsening != 2 && coarsening != 4)
    return emitError()
           << "(C4) expects a block coarsening of 1, 2 or 4 at most, but got "
           << coarsening;
  return success();
}

warp::VariantAttr warp::VariantAttr::getUnknown(MLIRContext *context) {
  auto target = TargetAttr::get(context, Platform::cpu, 0, "", 256);
  return get(context, target, /*rank=*/1, /*contiguous=*/0, /*index32=*/false,
             /*flat=*/false, /*large=*/false, /*underfilled=*/false,
             /*skinny=*/false, /*max_block_coarsening=*/1, /*disjoint=*/false,
             /*block=*/256,
             /*threads=*/16, /*min_blocks=*/0, /*lanes=*/0, /*inner_extent=*/0,
             /*debug=*/false, /*fast_math=*/false, Determinism::none);
}

bool warp::VariantAttr::hasWholeWarps() const {
  bool oneAxis = getRank() == 1 || getFlat();
  return getBlock() % 32 == 0 && (oneAxis || llvm::isPowerOf2_64(getBlock()));
}

//===----------------------------------------------------------------------===//
// Schedule
//===----------------------------------------------------------------------===//

namespace {
/// The fields of a schedule, so that one of them can be changed.
struct Fields {
  explicit Fields(warp::ScheduleAttr schedule)
      : context(schedule.getContext()), coarsening(schedule.getCoarsening()),
        rowCoarsening(schedule.getRowCoarsening()),
        transposeTile(schedule.getTransposeTile()),
        splitReduction(schedule.getSplitReduction()),
        blockCoarsening(schedule.getBlockCoarsening()),
        sizeFacts(schedule.getSizeFacts()), cost(schedule.getCost()),
        lanes(schedule.getLanes()), reverseOrder(schedule.getReverseOrder()),
        exclusive(schedule.getExclusive()),
        singleBlock(schedule.getSingleBlock()), copied(schedule.getCopied()),
        sums(schedule.getSums()) {}

  operator warp::ScheduleAttr() const {
    return warp::ScheduleAttr::get(
        context, coarsening, rowCoarsening, transposeTile, splitReduction,
        blockCoarsening, sizeFacts, reverseOrder, exclusive, singleBlock,
        copied, cost, lanes, sums);
  }

  MLIRContext *context;
  int64_t coarsening, rowCoarsening, transposeTile, splitReduction,
      blockCoarsening, sizeFacts, singleBlock, cost, lanes;
  bool reverseOrder, exclusive;
  warp::CopiedAttr copied;
  ArrayAttr sums;
};
} // namespace

warp::ScheduleAttr warp::ScheduleAttr::getUnknown(MLIRContext *context) {
  return get(context, /*coarsening=*/1, /*rowCoarsening=*/1,
             /*transposeTile=*/0, /*splitReduction=*/1, /*blockCoarsening=*/1,
             /*sizeFacts=*/0, /*reverseOrder=*/false, /*exclusive=*/false,
             /*singleBlock=*/0, CopiedAttr(), /*cost=*/0,
             /*lanes=*/1, ArrayAttr());
}

warp::ScheduleAttr
warp::ScheduleAttr::withCoarsening(int64_t coarsening) const {
  Fields fields(*this);
  fields.coarsening = coarsening;
  return fields;
}

warp::ScheduleAttr
warp::ScheduleAttr::withRowCoarsening(int64_t coarsening) const {
  Fields fields(*this);
  fields.rowCoarsening = coarsening;
  return fields;
}

warp::ScheduleAttr warp::ScheduleAttr::withTransposeTile(int64_t side) const {
  Fields fields(*this);
  fields.transposeTile = side;
  return fields;
}

warp::ScheduleAttr warp::ScheduleAttr::withSplitReduction(int64_t parts) const {
  Fields fields(*this);
  fields.splitReduction = parts;
  return fields;
}

warp::ScheduleAttr
warp::ScheduleAttr::withBlockCoarsening(int64_t coarsening) const {
  Fields fields(*this);
  fields.blockCoarsening = coarsening;
  return fields;
}

warp::ScheduleAttr warp::ScheduleAttr::withSizeFacts(int64_t facts) const {
  Fields fields(*this);
  fields.sizeFacts |= facts;
  return fields;
}

warp::ScheduleAttr warp::ScheduleAttr::withCopied(CopiedAttr copied) const {
  Fields fields(*this);
  fields.copied = copied;
  return fields;
}

warp::ScheduleAttr warp::ScheduleAttr::withCost(int64_t cost) const {
  Fields fields(*this);
  fields.cost = cost;
  return fields;
}

warp::ScheduleAttr warp::ScheduleAttr::withLanes(int64_t lanes) const {
  Fields fields(*this);
  fields.lanes = lanes;
  return fields;
}

warp::ScheduleAttr warp::ScheduleAttr::withSums(ArrayAttr sums) const {
  Fields fields(*this);
  fields.sums = sums;
  return fields;
}

warp::ScheduleAttr warp::ScheduleAttr::withReverseOrder(bool value) const {
  Fields fields(*this);
  fields.reverseOrder = value;
  return fields;
}

warp::ScheduleAttr warp::ScheduleAttr::withExclusive(bool value) const {
  Fields fields(*this);
  fields.exclusive = value;
  return fields;
}

warp::ScheduleAttr warp::ScheduleAttr::withSingleBlock(int64_t threads) const {
  Fields fields(*this);
  fields.singleBlock = threads;
  return fields;
}

SmallVector<warp::SummedArrayAttr> warp::ScheduleAttr::getSummedArrays() const {
  SmallVector<SummedArrayAttr> arrays;
  if (getSums())
    llvm::append_range(arrays, getSums().getAsRange<SummedArrayAttr>());
  return arrays;
}

int64_t warp::ScheduleAttr::countSums() const {
  return llvm::count_if(getSummedArrays(), [](SummedArrayAttr array) {
    return array.getWidth() != 0;
  });
}

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
                                        bool, bool, bool, int64_t joinable,
                                        bool, int64_t block, int64_t threads,
                                        int64_t, int64_t lanes, int64_t row,
                                        bool, bool, Determinism) {
  if (rank < 1 || rank > 4)
    return emitError() << "(C1) expects a launch of 1 to 4 dimensions, but got "
                       << rank;
  if (block < 1 || threads < 1)
    return emitError() << "(C2) expects 1 thread or more, but got "
                       << std::min(block, threads);
  for (auto [number, what] : {std::pair(lanes, "lanes"), {row, "in a row"}})
    if (number < 0 || number > 64 ||
        (number > 0 && !llvm::isPowerOf2_64(number)))
      return emitError() << "(C3) expects 1 to 64 " << what
                         << ", a power of two, or 0, but got " << number;
  if (joinable != 1 && joinable != 2 && joinable != 4)
    return emitError()
           << "(C4) expects 1, 2 or 4 blocks that may be one, but got "
           << joinable;
  return success();
}

warp::VariantAttr warp::VariantAttr::getUnknown(MLIRContext *context) {
  auto target = TargetAttr::get(context, Platform::cpu, 0, "", 256);
  return get(context, target, /*rank=*/1, /*contiguous=*/0, /*index32=*/false,
             /*flat=*/false, /*large=*/false, /*under=*/false,
             /*narrow=*/false, /*joinable=*/1, /*disjoint=*/false,
             /*block=*/256,
             /*threads=*/16, /*min_blocks=*/0, /*lanes=*/0, /*row=*/0,
             /*debug=*/false, /*fast_math=*/false, Determinism::none);
}

bool warp::VariantAttr::hasWholeWarps() const {
  bool oneAxis = getRank() == 1 || getFlat();
  return getBlock() % 32 == 0 && (oneAxis || llvm::isPowerOf2_64(getBlock()));
}

//===----------------------------------------------------------------------===//
// Recipe
//===----------------------------------------------------------------------===//

namespace {
/// The fields of a recipe, so that one of them can be changed.
struct Fields {
  explicit Fields(warp::RecipeAttr recipe)
      : context(recipe.getContext()), items(recipe.getItems()),
        rows(recipe.getRows()), tile(recipe.getTile()),
        split(recipe.getSplit()), joined(recipe.getJoined()),
        facts(recipe.getFacts()), cost(recipe.getCost()),
        lanes(recipe.getLanes()), alternates(recipe.getAlternates()),
        exclusive(recipe.getExclusive()), copied(recipe.getCopied()),
        sums(recipe.getSums()) {}

  operator warp::RecipeAttr() const {
    return warp::RecipeAttr::get(context, items, rows, tile, split, joined,
                                 facts, alternates, exclusive, copied, cost,
                                 lanes, sums);
  }

  MLIRContext *context;
  int64_t items, rows, tile, split, joined, facts, cost, lanes;
  bool alternates, exclusive;
  warp::CopiedAttr copied;
  ArrayAttr sums;
};
} // namespace

warp::RecipeAttr warp::RecipeAttr::getUnknown(MLIRContext *context) {
  return get(context, /*items=*/1, /*rows=*/1, /*tile=*/0, /*split=*/1,
             /*joined=*/1, /*facts=*/0, /*alternates=*/false,
             /*exclusive=*/false, CopiedAttr(), /*cost=*/0,
             /*lanes=*/1, ArrayAttr());
}

warp::RecipeAttr warp::RecipeAttr::withItems(int64_t items) const {
  Fields fields(*this);
  fields.items = items;
  return fields;
}

warp::RecipeAttr warp::RecipeAttr::withRows(int64_t rows) const {
  Fields fields(*this);
  fields.rows = rows;
  return fields;
}

warp::RecipeAttr warp::RecipeAttr::withTile(int64_t tile) const {
  Fields fields(*this);
  fields.tile = tile;
  return fields;
}

warp::RecipeAttr warp::RecipeAttr::withSplit(int64_t split) const {
  Fields fields(*this);
  fields.split = split;
  return fields;
}

warp::RecipeAttr warp::RecipeAttr::withJoined(int64_t joined) const {
  Fields fields(*this);
  fields.joined = joined;
  return fields;
}

warp::RecipeAttr warp::RecipeAttr::withFacts(int64_t facts) const {
  Fields fields(*this);
  fields.facts |= facts;
  return fields;
}

warp::RecipeAttr warp::RecipeAttr::withCopied(CopiedAttr copied) const {
  Fields fields(*this);
  fields.copied = copied;
  return fields;
}

warp::RecipeAttr warp::RecipeAttr::withCost(int64_t cost) const {
  Fields fields(*this);
  fields.cost = cost;
  return fields;
}

warp::RecipeAttr warp::RecipeAttr::withLanes(int64_t lanes) const {
  Fields fields(*this);
  fields.lanes = lanes;
  return fields;
}

warp::RecipeAttr warp::RecipeAttr::withSums(ArrayAttr sums) const {
  Fields fields(*this);
  fields.sums = sums;
  return fields;
}

warp::RecipeAttr warp::RecipeAttr::withAlternates() const {
  Fields fields(*this);
  fields.alternates = true;
  return fields;
}

warp::RecipeAttr warp::RecipeAttr::withExclusive() const {
  Fields fields(*this);
  fields.exclusive = true;
  return fields;
}

SmallVector<warp::SummedArrayAttr> warp::RecipeAttr::getSummedArrays() const {
  SmallVector<SummedArrayAttr> arrays;
  if (getSums())
    llvm::append_range(arrays, getSums().getAsRange<SummedArrayAttr>());
  return arrays;
}

int64_t warp::RecipeAttr::countSums() const {
  return llvm::count_if(getSummedArrays(), [](SummedArrayAttr array) {
    return array.getWidth() != 0;
  });
}

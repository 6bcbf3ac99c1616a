//===- WarpAttributes.cpp - Attributes of launches ------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "WarpDialect/WarpAttributes.h"
#include "WarpDialect/TileAttributes.h"

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
// Variant and schedule
//===----------------------------------------------------------------------===//

#define GET_LAUNCH_ATTRIBUTES
#include "warp/LaunchContract.h.inc"

warp::VariantAttr warp::VariantAttr::getUnknown(MLIRContext *context) {
  auto target = TargetAttr::get(context, Platform::cpu, 0, "", 256);
  return getDefault(target).withIndex32(false);
}

bool warp::VariantAttr::hasWholeWarps() const {
  bool oneAxis = getRank() == 1 || getFlat();
  return getBlockDim() % 32 == 0 &&
         (oneAxis || llvm::isPowerOf2_64(getBlockDim()));
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

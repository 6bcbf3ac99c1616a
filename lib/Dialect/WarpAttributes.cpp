//===- WarpAttributes.cpp - Attributes of launches ------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "WarpDialect/WarpAttributes.h"
#include "WarpDialect/TileAttributes.h"

#include "Targets/Target.h"
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

int64_t warp::getVectorBits(StringRef target) {
  const TargetInfo *info = parseTarget(target);
  return info ? info->getVectorBits() : 0;
}

LogicalResult warp::TargetAttr::verify(EmitError emitError, StringRef name,
                                       int64_t bits) {
  const TargetInfo *info = parseTarget(name);
  if (!info)
    return emitError() << "(C1) " << describeUnknownTarget(name);
  bool fits =
      info->isSimt() ? bits == 0 : bits == 128 || bits == 256 || bits == 512;
  if (!fits)
    return emitError() << "(C2) expects vectors of "
                       << (info->isSimt() ? "0" : "128, 256 or 512")
                       << " bits for '" << name << "', but got " << bits;
  return success();
}

const warp::TargetInfo &warp::TargetAttr::getInfo() const {
  return *parseTarget(getName());
}

int64_t warp::TargetAttr::getLanes(Type type) const {
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
  auto target = TargetAttr::get(context, "cpu", 256);
  return getDefault(target).withIndex32(false);
}

bool warp::VariantAttr::hasWholeWarps() const {
  bool oneAxis = getRank() == 1 || getFlat();
  return getTarget().getInfo().hasFullSubgroups(getBlockDim()) &&
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

//===- Regions.cpp - What part of an array a kernel touches ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Analysis/AccessRegions.h"
#include "Context.h"

#include "warp/Error.h"

#include "WarpDialect/WarpDialect.h"

using namespace mlir;

warp::RegionFormula warp::regionFormula(const Module &module) {
  ContextLock lock;
  for (auto function : module.getImpl()->op->getOps<func::FuncOp>())
    if (function->hasAttr(kernelAttrName))
      return findAccessRegions(function);
  throw Error(Error::Kind::Compile, "the module has no kernel");
}

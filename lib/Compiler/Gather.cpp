//===- Gather.cpp - Adjoints of stencils without atomics ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Analysis/Effects.h"
#include "Context.h"
#include "Pipelines.h"

#include "warp/Gather.h"

#include "WarpDialect/Passes.h"
#include "WarpDialect/TileOps.h"
#include "WarpDialect/WarpDialect.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/IR/Verifier.h"
#include "mlir/Pass/PassManager.h"

using namespace mlir;
using warp::Error;
using warp::GatheredAdjoint;

static int64_t countAtomicSums(ModuleOp module) {
  int64_t count = 0;
  module.walk([&](Operation *op) {
    if (auto sum = dyn_cast<warp::AccumulateOp>(op))
      count += !sum.getUnique().has_value();
    else if (auto tiles = dyn_cast<warp::TileAtomicOp>(op))
      count += tiles.getKind() == warp::TileUpdate::add;
  });
  return count;
}

namespace {
struct Gathering {
  Gathering() {
    passes.enableVerifier(false);
    warp::addGathering(passes);
  }

  PassManager passes{&warp::compilerContext()};
};
} // namespace

/// Takes sums apart from the rest, and simplifies both.
static void split(ModuleOp module) {
  warp::Diagnostics diagnostics;
  auto &gathering = warp::currentContext().passes<Gathering>();
  if (failed(gathering.passes.run(module)) || failed(verify(module)))
    throw diagnostics.toError(Error::Kind::Compile,
                              "the adjoint cannot be taken apart");
}

static bool hasEffects(ModuleOp module) {
  return module
      .walk([](Operation *op) {
        auto tiles = dyn_cast<warp::TileAccessOp>(op);
        bool writes = warp::isTileOp(op) && !(tiles && !tiles.mayWrite()) &&
                      !isMemoryEffectFree(op);
        return writes || warp::isObservable(op) ? WalkResult::interrupt()
                                                : WalkResult::advance();
      })
      .wasInterrupted();
}

std::optional<GatheredAdjoint> warp::gatherSums(const Module &adjoint) {
  ContextLock lock;
  ModuleOp given = *adjoint.getImpl()->op;
  if (countAtomicSums(given) == 0)
    return std::nullopt;
  auto sums = std::make_shared<Module::Impl>();
  sums->op = given.clone();
  split(*sums->op);
  if (!findMarked(*sums->op, attr::halo))
    return std::nullopt;
  auto rest = std::make_shared<Module::Impl>();
  rest->op = sums->op->clone();
  findMarked(*rest->op, attr::halo).erase();
  findMarked(*sums->op, kernelAttrName).erase();
  func::FuncOp kernel = findMarked(*sums->op, attr::halo);
  auto halo = cast<DenseI64ArrayAttr>(kernel->removeAttr(attr::halo));
  kernel->setAttr(kernelAttrName, UnitAttr::get(kernel.getContext()));
  GatheredAdjoint result{
      Module(sums), {}, std::nullopt, countAtomicSums(*rest->op)};
  result.halo.assign(halo.asArrayRef().begin(), halo.asArrayRef().end());
  if (hasEffects(*rest->op))
    result.rest = Module(rest);
  return result;
}

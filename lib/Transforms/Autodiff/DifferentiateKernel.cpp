//===- DifferentiateKernel.cpp - Automatic differentiation ----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Adds the derivative of the kernel to the module and makes it the kernel. The
// primal stays only if its derivative needs what a launch of it saves; it is
// changed to save that then.
//
//===----------------------------------------------------------------------===//

#include "Autodiff/ApartArrays.h"
#include "Autodiff/ChosenArrays.h"
#include "Autodiff/DeadValues.h"
#include "Autodiff/Forward/Forward.h"
#include "Autodiff/Loops/LastAssignments.h"
#include "Autodiff/OwnUpdates.h"
#include "Autodiff/Recording.h"
#include "Autodiff/Reverse/GuardArms.h"
#include "Autodiff/Reverse/Reverse.h"
#include "Autodiff/SaveForAdjoint.h"
#include "Autodiff/SpectralProducts.h"
#include "KernelFunction.h"
#include "LoweredOps.h"

#include "WarpDialect/LibraryOps.h"
#include "WarpDialect/WarpOps.h"
#include "warp/NativeCode.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "llvm/ADT/StringSwitch.h"

namespace warp {
#define GEN_PASS_DEF_DIFFERENTIATEKERNEL
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;
using namespace warp::autodiff;

static FailureOr<Singular> parseSingular(func::FuncOp kernel, StringRef name) {
  auto policy = llvm::StringSwitch<std::optional<Singular>>(name)
                    .Case("pinned", Singular::Pinned)
                    .Case("strict", Singular::Strict)
                    .Case("report", Singular::Report)
                    .Case("repeated", Singular::Pinned)
                    .Default(std::nullopt);
  if (policy)
    return *policy;
  return kernel.emitError("expects the policy for singular points to be "
                          "'pinned', 'strict', 'report' or 'repeated', but got "
                          "'")
         << name << "'";
}

/// Facts for the runtime and the user, apart from those that clean-up finds.
static void attachResults(func::FuncOp adjoint, const ReverseBuilder &builder) {
  Builder b(adjoint.getContext());
  SmallVector<std::string> notices;
  for (Operation *stop : builder.getActivity().getStops())
    notices.push_back(describePlace(stop->getLoc()) +
                      ": gradient stops at the conversion to an integer");
  auto strings = [&](ArrayRef<std::string> texts) {
    SmallVector<StringRef> list(texts.begin(), texts.end());
    return b.getStrArrayAttr(list);
  };
  if (!notices.empty())
    adjoint->setAttr(warp::attr::notices, strings(notices));
  attachPlaces(adjoint, builder.getSingularPlaces());
  StringRef reason = builder.getMemory().getOneThreadReason();
  if (!reason.empty())
    adjoint->setAttr(warp::attr::oneThread, b.getStringAttr(reason));
  adjoint->setAttr(
      warp::attr::metrics,
      b.getDictionaryAttr(
          {b.getNamedAttr("tape_bytes",
                          b.getI64IntegerAttr(builder.metrics.tapeBytes)),
           b.getNamedAttr(
               "tape_bytes_per_trip",
               b.getI64IntegerAttr(builder.metrics.tapeBytesPerTrip)),
           b.getNamedAttr("replay_loops",
                          b.getI64IntegerAttr(builder.metrics.replayLoops)),
           b.getNamedAttr(
               "ordered_reads",
               b.getI64IntegerAttr(builder.options.ordered.size()))}));
}

/// A function with the signature of the kernel, without a body.
static func::FuncOp createTwin(func::FuncOp kernel, StringRef suffix) {
  OpBuilder b(kernel.getContext());
  b.setInsertionPointAfter(kernel);
  std::string name = (kernel.getName() + suffix).str();
  auto twin =
      func::FuncOp::create(b, kernel.getLoc(), name, kernel.getFunctionType());
  for (NamedAttribute attr : kernel->getDiscardableAttrs())
    if (attr.getName() != apartAttrName &&
        attr.getName() != warp::attr::unrecorded)
      twin->setAttr(attr.getName(), attr.getValue());
  twin.addEntryBlock();
  return twin;
}

/// The effects of native code on memory are unknown, and memory behind an
/// address has no gradient.
static LogicalResult refuseNativeCode(func::FuncOp kernel) {
  WalkResult result = kernel.walk([](warp::LibraryCallOp op) {
    if (op.getCallee() == warp::threadMemory) {
      op.emitError("an array of a thread that is reached by its address has no "
                   "derivative: use slices, or several arrays");
      return WalkResult::interrupt();
    }
    if (!op.getCallee().starts_with(warp::nativeMemoryPrefix))
      return WalkResult::advance();
    op.emitError("native code with arrays has no derivative: give "
                 "`@wp.func_native` an `adj_snippet`");
    return WalkResult::interrupt();
  });
  return failure(result.wasInterrupted());
}

/// True if the condition of some loop is about memory alone.
static bool hasLoopWithoutResults(func::FuncOp kernel) {
  return kernel
      .walk([](scf::WhileOp loop) {
        return loop.getNumResults() == 0 ? WalkResult::interrupt()
                                         : WalkResult::advance();
      })
      .wasInterrupted();
}

/// True if the adjoint needs something that the launch has overwritten.
static bool lacksValues(func::FuncOp adjoint) {
  auto isLacking = [](Operation *op) {
    return op->hasAttr(warp::attr::unrecoverable) ? WalkResult::interrupt()
                                                  : WalkResult::advance();
  };
  if (!adjoint.walk(isLacking).wasInterrupted())
    return false;
  eraseDead(adjoint.getBody());
  return adjoint.walk(isLacking).wasInterrupted();
}

namespace {

struct DifferentiateKernel
    : warp::impl::DifferentiateKernelBase<DifferentiateKernel> {
  using DifferentiateKernelBase::DifferentiateKernelBase;

  void runOnOperation() override {
    auto kernel =
        dyn_cast_or_null<func::FuncOp>(warp::findKernel(getOperation()));
    if (!kernel || failed(differentiate(kernel)))
      return signalPassFailure();
    // A copy of a decomposition becomes one with it again.
    getOperation().walk(
        [](Operation *op) { op->removeDiscardableAttr(completeAttrName); });
  }

  /// Reads `active`; arrays after the last flag are not active.
  FailureOr<SmallVector<bool>> readFlags(func::FuncOp kernel) {
    SmallVector<bool> flags;
    for (char flag : active) {
      if (flag == ',')
        continue;
      if (flag != '0' && flag != '1')
        return kernel.emitError("expects 0 and 1 in 'active', but got '")
               << flag << "'";
      flags.push_back(flag == '1');
    }
    size_t count = warp::ArrayLeaves(kernel).size();
    if (!flags.empty())
      flags.resize(std::max(flags.size(), count));
    return flags;
  }

  LogicalResult differentiate(func::FuncOp kernel) {
    if (mode != "reverse" && mode != "forward" && mode != "winners")
      return kernel.emitError("expects the mode 'reverse', 'forward' or "
                              "'winners', but got '")
             << mode << "'";
    if (tape != "checkpoints" && tape != "global")
      return kernel.emitError("expects the tape 'checkpoints' or 'global', but "
                              "got '")
             << tape << "'";
    if (failed(warp::refuseLowered(kernel, "differentiate")) ||
        failed(refuseNativeCode(kernel)))
      return failure();
    auto policy = parseSingular(kernel, singular);
    FailureOr<SmallVector<bool>> flags = readFlags(kernel);
    if (failed(policy) || failed(flags))
      return failure();
    if (mode != "reverse")
      return buildForward(kernel, *policy, *flags);
    ReverseOptions options;
    options.singular = *policy;
    options.active = *flags;
    options.unique = unique;
    options.maxLocalTape = maxLocalTape;
    options.globalTape = tape == "global";
    options.dumpRecovery = dumpRecovery;
    // Forward mode chooses vectors that suit the direction.
    if (failed(completeSpectralProducts(kernel)))
      return failure();
    nameChosenArrays(kernel);
    trusted =
        splitTrustedUpdates(kernel, warp::ArrayLeaves(kernel), options.active);
    computeLastAssignments(kernel);
    log = MemoryLog();
    return buildReverse(kernel, options);
  }

  LogicalResult buildForward(func::FuncOp kernel, Singular policy,
                             ArrayRef<bool> flags) {
    ForwardOptions options;
    options.singular = policy;
    options.countRepeated = singular == "repeated";
    options.width = width;
    options.winners = mode == "winners";
    options.active.assign(flags.begin(), flags.end());
    splitExtrema(kernel);
    func::FuncOp dual = createTwin(kernel, "_tangent");
    ForwardBuilder forward(kernel, dual, options);
    if (failed(forward.build()))
      return failure();
    attachPlaces(dual, forward.getRepeatedPlaces());
    kernel.erase();
    return success();
  }

  /// Finds loads whose values the order of writes recovers, without a log.
  void compareOrders(func::FuncOp kernel, ReverseOptions &options) {
    warp::ArrayLeaves leaves(kernel);
    Activity activity(kernel, leaves, options.active);
    MemoryClasses memory(kernel, leaves, activity, options.unique);
    options.ordered = findOrderedReads(kernel, memory);
  }

  /// Lets the kernel run again before its adjoint, to keep what loops read.
  bool keepLog(func::FuncOp kernel, ReverseOptions &options,
               bool onlyIfShared) {
    warp::ArrayLeaves leaves(kernel);
    Activity activity(kernel, leaves, options.active);
    MemoryClasses memory(kernel, leaves, activity, options.unique);
    SmallVector<unsigned> shared = memory.findUnknownSharing();
    llvm::append_range(shared, llvm::make_first_range(trusted.arrays));
    if (options.log || (onlyIfShared && shared.empty()) ||
        !makeMemoryLog(kernel, memory, shared, options.ordered, log))
      return false;
    options.log = &log;
    options.untaped.clear();
    return true;
  }

  LogicalResult buildReverse(func::FuncOp kernel, ReverseOptions &options) {
    guardArms(kernel);
    compareOrders(kernel, options);
    keepLog(kernel, options, !hasLoopWithoutResults(kernel));
    if (!trusted.arrays.empty() && !options.log)
      return refuseReturned(trusted.arrays.front().second);
    func::FuncOp adjoint = createTwin(kernel, "_adjoint");
    ReverseBuilder builder(kernel, adjoint, options);
    if (failed(builder.build()))
      return failure();
    if (lacksValues(adjoint) &&
        keepLog(kernel, options, /*onlyIfShared=*/false)) {
      adjoint.erase();
      return buildReverse(kernel, options);
    }
    // A loop turned out to need values from memory after those within it had
    // got their tapes.
    if (!builder.untaped.empty()) {
      options.untaped.insert_range(builder.untaped);
      adjoint.erase();
      return buildReverse(kernel, options);
    }
    for (auto &[place, text] : builder.remarks)
      emitRemark(place) << text;
    attachResults(adjoint, builder);
    kernel->removeAttr(apartAttrName);
    kernel->removeAttr(warp::attr::unrecorded);
    if (saveForAdjoint(kernel, adjoint, builder.getMemory()))
      joinUpdates(trusted.updates);
    else
      kernel.erase();
    return success();
  }

  MemoryLog log;
  TrustedUpdates trusted;
};

} // namespace

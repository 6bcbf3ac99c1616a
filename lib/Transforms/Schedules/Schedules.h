//===- Schedules.h - Interface of launch schedules --------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A schedule rewrites a kernel for one kind of launch: it changes how launch
// indices, iterations or blocks are mapped to the threads of a GPU, and keeps
// what the kernel computes. Each is a file of this folder with the same four
// functions. Schedules.cpp lists them in order, ApplySchedules.cpp asks them,
// docs/schedules.md shows each before and after and how to add one.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_SCHEDULES_H
#define WARP_LIB_TRANSFORMS_SCHEDULES_H

#include "Analysis/ThreadVariance.h"
#include "KernelFunction.h"

#include <memory>

namespace warp {

class GridMapping;

/// The place of a rewrite: a kernel, or a loop of its entry.
struct ScheduleSite {
  explicit ScheduleSite(mlir::FunctionOpInterface function)
      : function(function), variant(getVariant(function)),
        target(getTarget(function)) {}

  mlir::FunctionOpInterface function;
  VariantAttr variant;
  const TargetInfo &target;
  /// In stage `threads`.
  ThreadsOp threads;
  /// In the stages of loops.
  mlir::scf::ForOp loop;
  /// In stage `threads`: the mapping that is chosen, and why the first that
  /// applies but does not pay was not.
  GridMapping *mapping = nullptr;
  std::string whyNotMapping;

  /// Variance of the function as it is; computed once until a rewrite.
  const ThreadVariance &getVariance() {
    if (!variance)
      variance.emplace(function);
    return *variance;
  }
  void invalidate() { variance.reset(); }

private:
  std::optional<ThreadVariance> variance;
};

/// One way to make launches, asked about one site.
class LaunchRewrite {
public:
  /// A line of `Kernel.schedule()`.
  struct Description {
    std::string what, value, reason;
    /// The operation that it is about, if that is not the kernel.
    mlir::Operation *place = nullptr;
  };

  explicit LaunchRewrite(ScheduleSite &site) : site(site) {}
  virtual ~LaunchRewrite() = default;

  /// True if the rewrite keeps what the kernel computes and some launch gains
  /// by it.
  virtual bool applies() = 0;
  /// True if launches of this variant gain. Asks of the size of a launch only
  /// what `sizeFacts` names.
  virtual bool profit() { return true; }
  /// Rewrites the site, and sets the schedule's fields of `#warp.schedule`.
  virtual void rewrite() = 0;
  /// The decision as text; no text if it is not worth a line.
  virtual Description describe(bool isMade) = 0;

  /// A mask of `SizeFact`.
  virtual int sizeFacts() const { return 0; }
  virtual GridMapping *asMapping() { return nullptr; }

protected:
  ScheduleSite &site;
};

/// An entry of the list of schedules.
struct ScheduleEntry {
  ScheduleStage stage;
  /// True if a processor has the features that the schedule needs.
  bool (*isSupported)(const TargetInfo &target);
  /// The benchmark that justifies it.
  llvm::StringLiteral benchmark;
  std::unique_ptr<LaunchRewrite> (*make)(ScheduleSite &site);
};

/// Defines the function by which the list makes a schedule.
#define WARP_MAKE_SCHEDULE(NAME)                                               \
  std::unique_ptr<warp::LaunchRewrite> make##NAME(warp::ScheduleSite &site) {  \
    return std::make_unique<NAME>(site);                                       \
  }

/// All schedules, in the order in which they are asked.
llvm::ArrayRef<ScheduleEntry> getSchedules();

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_SCHEDULES_H

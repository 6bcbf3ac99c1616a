//===- GraphPeel.cpp - Loop peeling: loops that run at least once ---------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A GPU needs longer to enter a body than to run some of its kernels, and no
// node of a body is fused with one ahead of the loop, runs beside it, or starts
// while it ends. If the condition is known to hold where a loop begins, the
// graph has the first turn ahead of the loop, which runs the others.
//
//===----------------------------------------------------------------------===//

#include "GraphPeel.h"

#include "GraphNodes.h"

#include <algorithm>

using namespace warp;
using Kind = GraphOperation::Kind;

static const GraphOperation *onlyOf(const GraphTrace &trace,
                                    const GraphStep &call) {
  return call.last - call.first == 1 ? &trace.operations[call.first] : nullptr;
}

namespace {
/// An int32 behind a fill.
enum class Filled { No, Partly, Zero, NotZero };
} // namespace

static Filled fillOf(const GraphOperation *operation, const int32_t *value) {
  if (!operation || operation->kind != Kind::FillBytes)
    return Filled::No;
  auto fill = operation->read<graphs::FillBytes>();
  const std::string &unit = operation->constant;
  auto begin = reinterpret_cast<uintptr_t>(fill.dst),
       end = begin + unit.size() * fill.count,
       first = reinterpret_cast<uintptr_t>(value);
  if (first + 4 <= begin || end <= first)
    return Filled::No;
  if (first < begin || end < first + 4)
    return Filled::Partly;
  bool isZero = true;
  for (size_t i = 0; i < 4; ++i)
    isZero &= unit[(first - begin + i) % unit.size()] == 0;
  return isZero ? Filled::Zero : Filled::NotZero;
}

/// True if a call may write an int32.
static bool mayWrite(const NodeRecord &record, const int32_t *value) {
  MemoryBlock block;
  block.start = reinterpret_cast<uintptr_t>(value);
  block.item = 4;
  Region region{{block}};
  return !record.barrier.empty() ||
         std::any_of(record.accesses.begin(), record.accesses.end(),
                     [&](const NodeAccess &access) {
                       return access.writes && access.region.overlaps(region);
                     });
}

bool warp::runsOnce(const GraphTrace &trace,
                    const std::vector<GraphStep> &calls) {
  const GraphOperation *setter =
      calls.empty() ? nullptr : onlyOf(trace, calls.back());
  if (!setter || setter->kind != Kind::Condition)
    return false;
  auto condition = setter->read<graphs::Condition>();
  Filled filled = Filled::No;
  size_t from = calls.size() - 1;
  // Nodes between two calls are of somebody else.
  while (filled == Filled::No && from > 0 &&
         calls[from].before == calls[from - 1].after)
    filled = fillOf(onlyOf(trace, calls[--from]), condition.value);
  if (filled != (condition.negated ? Filled::Zero : Filled::NotZero))
    return false;
  return std::none_of(calls.begin() + std::ptrdiff_t(from) + 1, calls.end() - 1,
                      [&](const GraphStep &call) {
                        return mayWrite(recordOf(trace, call.first, call.last),
                                        condition.value);
                      });
}

bool warp::isTurn(const GraphTrace &trace, const std::vector<GraphStep> &body,
                  const GraphStep &setter) {
  if (body.empty() || !body.front().before.empty())
    return false;
  for (size_t i = 1; i < body.size(); ++i)
    if (body[i].before != body[i - 1].after)
      return false;
  const GraphOperation *first = onlyOf(trace, setter),
                       *last = onlyOf(trace, body.back());
  return first && first->kind == Kind::Condition && last &&
         last->kind == Kind::UpdateCondition &&
         last->read<graphs::Condition>().number ==
             first->read<graphs::Condition>().number;
}

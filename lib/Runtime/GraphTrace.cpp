//===- GraphTrace.cpp - Trace of a capture, to be saved -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "GraphTrace.h"

#include "KernelImpl.h"
#include "warp/Graph.h"

#include <exception>

using namespace warp;
using Kind = GraphOperation::Kind;

std::atomic<int> warp::tracesInProgress{0};

/// How many scopes this thread is in.
static thread_local int depth = 0;

bool TraceScope::active() { return depth > 0; }

void TraceScope::enter(int device, const Stream *stream) {
  if (depth == 0)
    trace = findTrace(device, stream);
  ++depth;
  inside = true;
  exceptions = std::uncaught_exceptions();
  if (trace)
    before = trace->operations.size();
}

void TraceScope::leave() {
  --depth;
  if (trace && std::uncaught_exceptions() > exceptions)
    trace->operations.resize(before);
}

void GraphTrace::addLaunch(Kernel &kernel, const Kernel::Plan &plan,
                           const void *params) {
  GraphOperation &operation = operations.emplace_back();
  operation.kind = Kind::Launch;
  operation.kernel = &kernel;
  operation.plan = plan;
  operation.arguments.assign(static_cast<const char *>(params),
                             kernel.parameterSize());
  LaunchHeader header;
  std::memcpy(&header, params, sizeof(header));
  operation.dim.rank = plan.variant->key.rank;
  for (int i = 0; i < operation.dim.rank; ++i)
    operation.dim.extent[i] = header.dim[i];
}

void GraphTrace::addOther(std::string what) {
  operations.emplace_back().constant = std::move(what);
}

//===----------------------------------------------------------------------===//
// Branches and loops
//===----------------------------------------------------------------------===//

void GraphTrace::setCondition(Kind kind, uint32_t number, const int32_t *value,
                              bool negated) {
  add(kind, graphs::Condition{value, number, negated});
}

void GraphTrace::addCondition(uint64_t handle, const int32_t *value,
                              bool negated) {
  numbers[handle] = conditions;
  setCondition(Kind::Condition, conditions++, value, negated);
}

void GraphTrace::updateCondition(uint64_t handle, const int32_t *value,
                                 bool negated) {
  setCondition(Kind::UpdateCondition, numbers.at(handle), value, negated);
}

void GraphTrace::beginBody(uint64_t handle, bool loop) {
  add(Kind::BeginBody, graphs::Body{numbers.at(handle), loop});
}

void GraphTrace::endBody() { operations.emplace_back().kind = Kind::EndBody; }

//===----------------------------------------------------------------------===//
// Graphs in graphs
//===----------------------------------------------------------------------===//

template <typename T>
static void moveNumber(GraphOperation &operation, uint32_t first) {
  auto arguments = operation.read<T>();
  arguments.number += first;
  std::memcpy(operation.arguments.data(), &arguments, sizeof(T));
}

void GraphTrace::addGraph(const Graph &graph) {
  const GraphTrace *other = graph.trace();
  if (!other)
    return addOther("a graph that was captured without `apic=True`");
  for (GraphOperation operation : other->operations) {
    if (operation.kind == Kind::Condition ||
        operation.kind == Kind::UpdateCondition)
      moveNumber<graphs::Condition>(operation, conditions);
    if (operation.kind == Kind::BeginBody)
      moveNumber<graphs::Body>(operation, conditions);
    operations.push_back(std::move(operation));
  }
  conditions += other->conditions;
}

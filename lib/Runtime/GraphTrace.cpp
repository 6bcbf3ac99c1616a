//===- GraphTrace.cpp - Trace of a capture, to be saved -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "GraphTrace.h"

#include "GraphImpl.h"
#include "KernelImpl.h"
#include "LaunchQueue.h"

#include <exception>
#include <utility>

using namespace warp;
using Kind = GraphOperation::Kind;

std::atomic<int> warp::tracesInProgress{0};

/// How many scopes this thread is in.
static thread_local int depth = 0;

bool TraceScope::active() { return depth > 0; }

OutsideTraces::OutsideTraces() : depth(std::exchange(::depth, 0)) {}

OutsideTraces::~OutsideTraces() { ::depth = depth; }

void TraceScope::enter(int device, const Stream *stream) {
  // Operations that wait are noted first.
  if (depth == 0)
    drainLaunches();
  if (depth == 0)
    capture = findTraced(device, stream);
  ++depth;
  inside = true;
  exceptions = std::uncaught_exceptions();
  if (!capture)
    return;
  trace = capture->trace();
  this->stream = stream;
  step = std::make_unique<GraphStep>();
  step->first = trace->operations.size();
  step->before = capture->position(stream);
}

void TraceScope::leave() {
  --depth;
  if (!trace)
    return;
  if (std::uncaught_exceptions() > exceptions)
    return trace->operations.resize(step->first);
  step->last = trace->operations.size();
  step->after = capture->position(stream);
  if (step->after != step->before)
    trace->steps.back().push_back(std::move(*step));
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

void GraphTrace::addUpload(void *dst, const void *src, size_t bytes) {
  if (isSaved)
    return add(Kind::Upload, graphs::Upload{dst},
               std::string(static_cast<const char *>(src), bytes));
  add(Kind::CopyBytes, graphs::CopyBytes{dst, src, bytes});
  operations.back().fromHost = true;
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
  begins.push_back(operations.size());
  add(Kind::BeginBody, graphs::Body{numbers.at(handle), loop});
  steps.emplace_back();
}

void GraphTrace::endBody() {
  operations.emplace_back().kind = Kind::EndBody;
  bodies[begins.back()] = std::move(steps.back());
  begins.pop_back();
  steps.pop_back();
}

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
  const GraphTrace *other = graph.operations();
  if (!other || other->isSaved < isSaved)
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

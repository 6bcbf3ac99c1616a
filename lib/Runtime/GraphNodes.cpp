//===- GraphNodes.cpp - Access regions of a graph's nodes -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Launches have the regions that their kernel's formula gives for the arguments
// of the launch, gradients as a whole. Other operations have the memory that
// their pointers reach. Conditions and output have addresses of their own,
// which no memory has. Memory that an operation allocates for itself is nobody
// else's as long as the graph lives, and so is left out.
//
//===----------------------------------------------------------------------===//

#include "GraphNodes.h"

#include "GraphOperations.h"
#include "KernelImpl.h"
#include "warp/SparseProduct.h"

#include <cstddef>

using namespace warp;
using Kind = GraphOperation::Kind;

namespace {
class Recorder {
public:
  explicit Recorder(NodeRecord &record) : record(record) {}
  void add(const GraphOperation &operation);

private:
  void touch(const MemoryBlock &block, bool writes, std::string name = {});
  void touch(uint64_t begin, uint64_t end, bool writes, std::string name = {});
  void addLaunch(const GraphOperation &operation);
  void addGradient(const Access &access, const ArrayDescriptor &array,
                   const std::string &name);
  void addPointers(const GraphOperation &operation);
  void close(const std::string &why) {
    if (record.barrier.empty())
      record.barrier = why;
  }

  NodeRecord &record;
};
} // namespace

void Recorder::touch(const MemoryBlock &block, bool writes, std::string name) {
  if (block.item == 0)
    return;
  record.accesses.push_back({{{block}}, writes, std::move(name)});
  record.bytes += block.bytes();
}

void Recorder::touch(uint64_t begin, uint64_t end, bool writes,
                     std::string name) {
  if (begin == end)
    return;
  MemoryBlock block;
  block.start = begin;
  block.item = int64_t(end - begin);
  touch(block, writes, std::move(name));
}

//===----------------------------------------------------------------------===//
// Launches
//===----------------------------------------------------------------------===//

/// The parameter that has a byte of the block.
static std::string nameAt(const std::vector<Param> &params, int64_t offset) {
  for (const Param &param : params)
    if (param.offset <= offset && offset < param.offset + param.size)
      return param.name;
  return "?";
}

void Recorder::addGradient(const Access &access, const ArrayDescriptor &array,
                           const std::string &name) {
  if (!access.gradientSize || !access.elementSize || !array.grad)
    return;
  AddressRange range = rangeOf(array.grad, array, access.gradientSize,
                               access.gradientSize / access.elementSize);
  touch(range.begin, range.end, true, name + ".grad");
}

void Recorder::addLaunch(const GraphOperation &operation) {
  Kernel &kernel = *operation.kernel;
  record.threads += operation.plan.items;
  if (Kernel::reports(operation.plan))
    return close("it reports failed checks");
  const RegionFormula &formula = kernel.regionFormula();
  if (formula.isOpen)
    return close("it may reach memory that no argument names");
  if (formula.prints)
    touch(outputAddress, outputAddress + 1, true, "output");
  const std::vector<Access> &accesses = kernel.arrayAccesses();
  std::vector<ArrayRegions> regions;
  findRegions(formula, accesses, operation.dim, operation.arguments.data(),
              regions);
  for (size_t i = 0; i < accesses.size(); ++i) {
    std::string name = nameAt(kernel.parameters(), accesses[i].offset);
    for (auto [region, writes] : {std::pair(&regions[i].read, false),
                                  std::pair(&regions[i].written, true)}) {
      if (region->blocks.empty())
        continue;
      record.bytes += region->bytes();
      record.accesses.push_back({std::move(*region), writes, name});
    }
    ArrayDescriptor array;
    std::memcpy(&array, operation.arguments.data() + accesses[i].offset,
                sizeof(array));
    addGradient(accesses[i], array, name);
    // Sums are rounded wherever the array has elements.
    if (accesses[i].combined && array.data &&
        !operation.plan.variant->code.schedule.sums.empty()) {
      AddressRange all = rangeOf(array.data, array, accesses[i].elementSize, 1);
      touch(all.begin, all.end, true, name);
    }
  }
}

//===----------------------------------------------------------------------===//
// Other operations
//===----------------------------------------------------------------------===//

/// True if memory behind the pointer at a byte of the arguments is only read.
static bool isReadOnly(Kind kind, size_t slot) {
  switch (kind) {
  case Kind::CopyBytes:
    return slot == offsetof(graphs::CopyBytes, src);
  case Kind::Scan:
    return slot == offsetof(graphs::Scan, in);
  case Kind::SortSegments:
    return slot == offsetof(graphs::SortSegments, begins) ||
           slot == offsetof(graphs::SortSegments, ends);
  case Kind::FindRuns:
    return slot == offsetof(graphs::FindRuns, numbers);
  case Kind::BuildTree:
    return slot == offsetof(graphs::BuildTree, first) ||
           slot == offsetof(graphs::BuildTree, second);
  case Kind::MultiplyRows:
    return slot != offsetof(SparseProduct, y);
  case Kind::Condition:
  case Kind::UpdateCondition:
    return true;
  default:
    return false;
  }
}

void Recorder::addPointers(const GraphOperation &operation) {
  for (const graphs::Pointer &pointer : graphs::pointersOf(operation, {})) {
    bool writes = !isReadOnly(operation.kind, pointer.slot);
    size_t before = record.accesses.size();
    touch(pointer.range.begin, pointer.range.end, writes);
    if (record.accesses.size() > before)
      record.accesses.back().isOnHost =
          writes ? operation.toHost : operation.fromHost;
  }
}

void Recorder::add(const GraphOperation &operation) {
  auto touchCondition = [&](uint32_t number, bool writes) {
    uint64_t address = outputAddress + 1 + number;
    touch(address, address + 1, writes, "a condition");
  };
  switch (operation.kind) {
  case Kind::Launch:
    return addLaunch(operation);
  case Kind::CopyArray: {
    auto copy = operation.read<graphs::CopyArray>();
    touch(blockOf(copy.dst, int64_t(copy.elementSize)), true);
    return touch(blockOf(copy.src, int64_t(copy.elementSize)), false);
  }
  case Kind::FillArray:
    return touch(blockOf(operation.read<graphs::FillArray>().dst,
                         int64_t(operation.constant.size())),
                 true);
  case Kind::Condition:
  case Kind::UpdateCondition:
    touchCondition(operation.read<graphs::Condition>().number, true);
    return addPointers(operation);
  case Kind::BeginBody:
    return touchCondition(operation.read<graphs::Body>().number, false);
  case Kind::EndBody:
    return;
  case Kind::UpdateGeometry:
    return close("the host builds geometry");
  case Kind::Other:
    record.isOwn = false;
    return close("it is " + operation.constant);
  default:
    return addPointers(operation);
  }
}

static std::string nameOf(const GraphTrace &trace, size_t first, size_t last) {
  if (first == last)
    return "nothing";
  const GraphOperation &operation = trace.operations[first];
  if (operation.kind == Kind::Launch)
    return operation.kernel->name();
  if (operation.kind == Kind::BeginBody)
    return operation.read<graphs::Body>().loop ? "while" : "if";
  if (operation.kind == Kind::Condition ||
      operation.kind == Kind::UpdateCondition)
    return "condition";
  return last - first == 1 ? graphs::describe(operation) : "graph";
}

NodeRecord warp::recordOf(const GraphTrace &trace, size_t first, size_t last) {
  NodeRecord record;
  record.name = nameOf(trace, first, last);
  Recorder recorder(record);
  for (size_t i = first; i < last; ++i)
    recorder.add(trace.operations[i]);
  if (last - first == 1 && trace.operations[first].kind == Kind::Launch)
    record.launch = &trace.operations[first];
  if (last - first == 1 && trace.operations[first].kind == Kind::FillBytes)
    record.fill = &trace.operations[first];
  return record;
}

NodeRecord warp::unknownNode(std::string what) {
  NodeRecord record;
  record.name = std::move(what);
  record.barrier = "it is not the runtime's own";
  record.isOwn = false;
  return record;
}
